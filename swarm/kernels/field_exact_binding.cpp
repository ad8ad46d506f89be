// Python face of the proven optimum and of the best lists of one UAV; see field_exact.hpp.
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "field_binding.hpp"
#include "field_exact.hpp"
#include "watch_binding.hpp"

namespace peckorder {

namespace {

using Size = std::size_t;
using Lists = std::vector<FieldList>;

// As Python tells of a team: the fields of swarm.allocation.field.FieldState, in their order.
using TeamTuple = std::tuple<In<double, 1>, In<double, 1>, In<double, 2>, In<double, 1>,
                             In<bool, 1>, In<bool, 1>, In<std::int32_t, 1>, In<std::int64_t, 1>>;

BoundFieldTeam bound_team(const TeamTuple& given) {
    return {std::get<0>(given), std::get<1>(given), std::get<2>(given), std::get<3>(given),
            std::get<4>(given), std::get<5>(given), std::get<6>(given), std::get<7>(given)};
}

void require_lists(const FieldProblem& problem, const FieldTeam& team, const Lists& lists) {
    if (lists.empty()) return;
    if (lists.size() != static_cast<Size>(problem.n_uav)) refuse("known must be a list per UAV");
    std::vector<std::uint8_t> taken(static_cast<Size>(problem.n_task), 0);
    for (Size uav = 0; uav < lists.size(); ++uav) {
        if (!lists[uav].empty() && !team.active[uav]) refuse("known has a list for who is inactive");
        for (const Item item : lists[uav]) {
            if (is_base(item)) {
                if (base_of(item) >= problem.n_base) refuse("known visits a base that there isn't");
                continue;
            }
            const int task = task_of(item);
            if (task >= problem.n_task || !team.open[task] || taken[static_cast<Size>(task)]++) {
                refuse("known must have open tasks, each at most once");
            }
        }
    }
}

std::tuple<int, bool, int, double, Lists> optimum(const BoundField& field, const TeamTuple& given,
                                                  const Lists& known, int threads,
                                                  nb::handle should_stop) {
    const BoundFieldTeam arrays = bound_team(given);
    const FieldTeam team = arrays.checked(field.problem);
    require_lists(field.problem, team, known);
    if (threads < 1 || threads > 1024) refuse("threads must be within 1..1024");
    FieldOptimum best;
    PythonWatch(should_stop).released([&](Watch& watch) {
        best = field_optimum(field.problem, team, known, threads, watch);
    });
    return {static_cast<int>(best.outcome), best.found, best.n_left_out, best.objective,
            std::move(best.lists)};
}

std::tuple<int, int, double, FieldList> own_best(const BoundField& field, const TeamTuple& given,
                                                 int uav, nb::handle should_stop) {
    const FieldProblem& problem = field.problem;
    const BoundFieldTeam arrays = bound_team(given);
    const FieldTeam team = arrays.checked(problem);
    if (uav < 0 || uav >= problem.n_uav) refuse("uav must be the index of a UAV");
    if (!std::isfinite(team.free_s[uav])) refuse("uav must be one that decides");
    OwnQuestion question;
    question.problem = &problem;
    question.uav = uav;
    question.begin = team.begin(problem, uav);
    question.landed_at = team.landed_at[uav];
    question.base_use.assign(static_cast<Size>(problem.n_base), BaseUse::kFree);
    for (int task = 0; task < problem.n_task; ++task) {
        if (team.open[task] && problem.capable[problem.at(uav, task)]) {
            question.tasks.push_back(task);
        }
    }
    if (question.tasks.size() > static_cast<Size>(kMostOwnTasks)) {
        refuse("open must have at most " + std::to_string(kMostOwnTasks) + " tasks for that UAV");
    }
    OwnBest best;
    PythonWatch(should_stop).released([&](Watch& watch) { best = best_list(question, watch); });
    return {static_cast<int>(best.outcome), best.n_left_out, best.value, std::move(best.list)};
}

}  // namespace

void bind_field_exact(nb::module_& module) {
    module.attr("MOST_FIELD_TASKS") = kMostOwnTasks;
    module.def("field_optimum", &optimum, nb::arg("problem"), nb::arg("team"), nb::arg("known"),
               nb::arg("threads"), nb::arg("should_stop") = nb::none());
    module.def("field_best_list", &own_best, nb::arg("problem"), nb::arg("team"), nb::arg("uav"),
               nb::arg("should_stop") = nb::none());
}

}  // namespace peckorder
