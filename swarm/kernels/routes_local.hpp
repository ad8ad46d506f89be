// Local search on whole lists: every move is valued in O(1) from joined segments.
//
// Within a list: reversal of any part (2-opt), and exchange of two neighbouring parts of which
// one has at most three tasks, reversed or not (or-opt). Between two lists that come near each
// other: moving one to three tasks, reversed or not; exchanging two tasks; exchanging the tails
// (2-opt*), whose numbers for the other UAV are worked out once per pair of lists.
#pragma once

#include "routes_solution.hpp"
#include "watch.hpp"

namespace peckorder {

// Apply the best move of a list or of a pair of lists until none gains, or until the watch stops
// it; deterministic but for that. Only the lists of `uavs`, ascending, change.
void improve(Solution& solution, const std::vector<int>& uavs, Watch& watch);

inline void improve(Solution& solution, const std::vector<int>& uavs) {
  Watch never;
  improve(solution, uavs, never);
}

// Worth, for `uav`, of flying `middle` from `place` on and then its own list from `next` on.
double worth_from(const Solution& solution, int uav, int place, const Segment& middle, int next);

}  // namespace peckorder
