// One online decision of the rule `guided` (a fortified rollout, see swarm/kernels/rollout.py).
#pragma once

#include <utility>
#include <vector>

#include "routes_solution.hpp"

namespace peckorder {

struct GuidedChoice {
  int task = -1;        // -1: better to take nothing
  double worth = 0.0;   // J to go of the whole team with it
  double second = 0.0;  // the same for the best other candidate; NaN if there is none
  int planned = -1;     // what the lists, repaired, had the UAV do
  std::vector<std::pair<int, double>> valued;  // tasks with their worth: that one, then best first
};

// Lists name open tasks only. `iterations` > 0 searches around the deciding UAV unless it idles, as
// `count_idle` has it; otherwise the choice is between the lists as they are and other first tasks.
GuidedChoice guided_choice(const Problem& problem, const Start& start,
                           const std::vector<Route>& lists, const std::vector<int>& open, int uav,
                           long iterations);

// How many of these UAVs, one after the other, have no task on their lists, nor one that would be
// worth more there. Each then takes nothing, and leaves the lists as they are for the next.
int count_idle(const Problem& problem, const Start& start, const std::vector<Route>& lists,
               const std::vector<int>& open, const std::vector<int>& uavs);

}  // namespace peckorder
