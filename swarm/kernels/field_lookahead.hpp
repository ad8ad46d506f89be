// The best list of one UAV over all open tasks, as if it were alone and every slot free.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "field.hpp"
#include "field_labels.hpp"

namespace peckorder {

// So many tasks that it is capable of are gone through exactly.
constexpr int kExactOwnTasks = 10;

struct OwnPlan {
    FieldList list;
    double value = 0.0;
    bool exact = false;
};

// Work after which the exact search is given up, as counted for a Watch: a decision is not to take
// much longer in a few than in most. That depends on nothing but the question.
constexpr std::int64_t kMostExactSteps = 2'000'000;

// By (fewest required tasks left out, then largest J). Beyond kExactOwnTasks tasks, or that work,
// `begin_with()`, a list that can be done, is improved: tasks that are not on it are put in, with a
// swap before them if that takes one, and items are moved, as long as it gets better. `landed_at`:
// the base at which the UAV stands, or -1. `may_swap`: whether the list may hold bases.
OwnPlan own_plan(const FieldProblem& problem, int uav, const Progress& begin, int landed_at,
                 const std::vector<int>& open, bool may_swap,
                 const std::function<FieldList()>& begin_with);

}  // namespace peckorder
