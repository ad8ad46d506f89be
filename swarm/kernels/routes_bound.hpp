// The best list of one UAV against prices of tasks, relaxed: what a Lagrangian bound is made of.
//
// Times are counted in whole buckets, each leg rounded down, and a task may be visited again; so
// the value found is never below that of any real list. A search among real lists, which that
// value guides and to which survival matters, may then bring it down. See coordinator/planner/bound.py.
#pragma once

#include <cstddef>
#include <vector>

#include "routes_pricing.hpp"
#include "watch.hpp"

namespace peckorder {

// What each UAV can complete when, and how long it takes there, where the problem's places,
// speeds and horizon do not say it all. Rows are UAVs, columns tasks; times count from the mission's
// begin, whatever `Start` says.
struct Timetable {
  int n_task;
  std::vector<double> first_s;         // from the UAV's start to completing the task
  std::vector<double> leg_s;           // (n_uav, n_task, n_task) from completing one to another
  std::vector<double> earliest_s;      // a UAV that would complete it sooner waits
  std::vector<double> latest_s;        // later it is worth nothing, nor is what follows

  std::size_t at(int uav, int task) const {
    return static_cast<std::size_t>(uav) * n_task + task;
  }
};

// What is asked of `relaxed_lists`.
struct RelaxedPricing {
  const std::vector<int>& open;        // tasks
  const std::vector<double>& prices;   // (n_task,)
  double bucket_s;                     // > 0
  const Timetable* timetable;          // null: as the problem says
  long expansions;                     // of the search among real lists, per UAV; 0: none
  int threads;
};

// The best relaxed list of each UAV, or a real one where the search among these ended; the inactive
// ones included. A task may come more than once; what a list is worth before paying is `bound` and
// what it pays. The same for any number of threads; of no use once the watch has stopped it.
std::vector<PricedList> relaxed_lists(const Problem& problem, const Start& start,
                                      const RelaxedPricing& pricing, Watch& watch);

// Per UAV all real lists whose last task gains something and that earn at least `most` of it less the
// slack, where no list earns more than `most`; of those with the same tasks the best. `expansions`
// beginnings are looked at, at most, per UAV.
std::vector<WorthyLists> worthy_timed_lists(const Problem& problem, const Start& start,
                                            const RelaxedPricing& pricing,
                                            const std::vector<double>& most, double slack,
                                            Watch& watch);

}  // namespace peckorder
