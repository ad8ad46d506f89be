// When each UAV has done each task at the earliest, if that is its only one; see field_alone.py.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "field_binding.hpp"

namespace peckorder {

namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

// The earliest end of every task from `origin` on, where that is before what is known.
void do_each(const FieldProblem& problem, int uav, const Progress& origin, double* end_s) {
    for (int task = 0; task < problem.n_task; ++task) {
        for (int backwards = 0; backwards <= problem.is_line[task]; ++backwards) {
            Progress progress = origin;
            Times times{};
            const Item item = item_of_task(task, backwards);
            if (do_task(problem, uav, item, progress, times) == Refusal::kNone) {
                end_s[task] = std::min(end_s[task], times.end_s);
            }
        }
    }
}

// Dijkstra over the bases: who is ready earlier can do whatever one could that is ready later, as
// it may wait on the ground.
void do_alone(const FieldProblem& problem, int uav, const Progress& start, double* end_s) {
    if (!std::isfinite(start.time_s)) return;
    do_each(problem, uav, start, end_s);
    if (problem.full_s[uav] == kNever) return;  // there is nothing to swap
    std::vector<Progress> ready(static_cast<std::size_t>(problem.n_base));
    std::vector<char> done(ready.size(), 0);
    for (Progress& progress : ready) progress.time_s = kNever;
    Progress here = start;
    while (true) {
        for (int base = 0; base < problem.n_base; ++base) {
            if (done[base]) continue;
            Progress progress = here;
            Times times{};
            const Item item = item_of_base(base);
            if (do_item(problem, uav, item, progress, times) == Refusal::kNone &&
                progress.time_s < ready[base].time_s) {
                ready[base] = progress;
            }
        }
        int next = -1;
        for (int base = 0; base < problem.n_base; ++base) {
            if (done[base] || ready[base].time_s == kNever) continue;
            if (next < 0 || ready[base].time_s < ready[next].time_s) next = base;
        }
        if (next < 0) return;
        done[next] = 1;
        here = ready[next];
        do_each(problem, uav, here, end_s);
    }
}

Out<double, 2> earliest_alone(const BoundField& field, const BoundFieldTeam& given) {
    const FieldProblem& problem = field.problem;
    const FieldTeam team = given.checked(problem);
    const auto n_uav = static_cast<std::size_t>(problem.n_uav);
    const auto n_task = static_cast<std::size_t>(problem.n_task);
    std::vector<double> end_s(n_uav * n_task, kNever);
    {
        nb::gil_scoped_release unlocked;
        for (int uav = 0; uav < problem.n_uav; ++uav) {
            if (!team.active[uav]) continue;
            do_alone(problem, uav, team.begin(problem, uav), end_s.data() + problem.at(uav, 0));
        }
    }
    const std::size_t shape[2] = {n_uav, n_task};
    return give<double, 2>(std::move(end_s), shape);
}

}  // namespace

void bind_field_alone(nb::module_& module) {
    module.def(
        "earliest_alone",
        [](const BoundField& problem, In<double, 1> free_s, In<double, 1> sortie_end_s,
           In<double, 2> first_s, In<double, 1> survived, In<bool, 1> active, In<bool, 1> open,
           In<std::int32_t, 1> landed_at, In<std::int64_t, 1> rank) {
            return earliest_alone(
                problem, {free_s, sortie_end_s, first_s, survived, active, open, landed_at, rank});
        },
        nb::arg("problem"), nb::arg("free_s").noconvert(), nb::arg("sortie_end_s").noconvert(),
        nb::arg("first_s").noconvert(), nb::arg("survived").noconvert(),
        nb::arg("active").noconvert(), nb::arg("open").noconvert(),
        nb::arg("landed_at").noconvert(), nb::arg("rank").noconvert());
}

}  // namespace peckorder
