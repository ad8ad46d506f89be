// The proven optimum of the field's problem for small teams; see field_exact.cpp.
#pragma once

#include <vector>

#include "field.hpp"
#include "field_labels.hpp"
#include "watch.hpp"

namespace peckorder {

struct FieldOptimum {
    Outcome outcome = Outcome::kProven;  // otherwise the best found until then, if anything
    bool found = false;
    int n_left_out = 0;  // open tasks without due_s that are on no list
    double objective = 0.0;
    std::vector<FieldList> lists;  // one of each UAV
};

// The best lists of all UAVs that take part. `known` are lists to be better than (one of each UAV,
// or none at all); those that can't be flown count for nothing.
FieldOptimum field_optimum(const FieldProblem& problem, const FieldTeam& team,
                           const std::vector<FieldList>& known, int threads, Watch& watch);

// How many tasks the optimum would have to divide: open ones that somebody taking part is capable
// of. More than kMostOwnTasks are too many.
std::vector<int> tasks_to_divide(const FieldProblem& problem, const FieldTeam& team);

}  // namespace peckorder
