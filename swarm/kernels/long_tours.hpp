// A good complete tour of one UAV over many tasks, without proof.
#pragma once

#include <vector>

namespace peckorder {

// One UAV, n tasks that are all to be toured; columns by position 0..n-1.
struct TourProblem {
    int n = 0;
    double horizon_s = 1.0;
    const double* completion_s = nullptr;  // of each task if it is first
    const double* weight = nullptr;
    const double* survival = nullptr;
    const double* leg_s = nullptr;  // from completing i to completing j at [i * n + j]
};

struct GoodTour {
    std::vector<int> order;
    double value = 0.0;   // its worth with S = 1 before it
    double second = 0.0;  // the best worth found among tours that begin with another task
};

double tour_value(const TourProblem& problem, const std::vector<int>& order);

// Beam search, then local search by reversals, moves of one to three tasks and swaps, each looked at
// in constant time. n >= 2. Deterministic; the work is bounded, so tours over hundreds of tasks get
// less care than tours over dozens.
GoodTour good_tour(const TourProblem& problem);

}  // namespace peckorder
