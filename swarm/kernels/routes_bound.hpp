// The best list of one UAV against prices of tasks, relaxed: what a Lagrangian bound is made of.
//
// Times are counted in whole buckets, each leg rounded down, and a task may be visited again; so
// the value found is never below that of any real list. See coordinator/planner/bound.py.
#pragma once

#include <vector>

#include "routes_instance.hpp"

namespace peckorder {

// The shortest leg any active UAV can fly, service included, also from its start [s].
double shortest_leg_s(const Instance& instance, const Start& start);

// Σ over `uavs` of max(0, best relaxed list); visits[i] counts task i on the lists found.
// `bucket_s` is positive and not above the shortest leg. The same for any number of threads.
double priced_lists(const Instance& instance, const Start& start, const std::vector<int>& open,
                    const std::vector<double>& prices, double bucket_s, int threads,
                    std::vector<int>& visits);

}  // namespace peckorder
