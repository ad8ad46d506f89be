// What each task would add to one UAV's list at its best place; see swarm.kernels.field_insertion.
#include <nanobind/stl/tuple.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <tuple>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "field_binding.hpp"
#include "field_list.hpp"

namespace peckorder {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The slots that are held by who stands at a base now; nobody's further visits are known.
void stand(const FieldProblem& problem, const FieldTeam& team, int but, Stays& stays) {
    for (int uav = 0; uav < problem.n_uav; ++uav) {
        std::vector<Stay> own;
        const int leaving = team.leaving_base(uav), base = team.landed_at[uav];
        if (leaving >= 0 && stays.limited(leaving)) {
            own.push_back({leaving, -kInfinity, team.leaves_s[uav]});
        }
        if (uav != but && base >= 0 && stays.limited(base)) {
            const double until_s = idle_until_s(team, uav);
            if (team.is_bound(uav)) {
                own.push_back({base, team.arrives_s[uav], until_s});
            } else if (team.stands_on_slot(uav)) {
                own.push_back({base, -kInfinity, until_s});
            }
        }
        stays.set(uav, own);
    }
}

using Gains = std::tuple<Out<double, 1>, Out<std::int32_t, 1>>;

Gains best_insertions(const BoundField& field, const BoundFieldTeam& given, int uav,
                      const In<std::int32_t, 1>& order, const In<bool, 1>& wanted) {
    const FieldProblem& problem = field.problem;
    if (uav < 0 || uav >= problem.n_uav) refuse("uav must be an index of a UAV");
    require_shape("wanted", wanted, {static_cast<std::size_t>(problem.n_task)});
    const FieldTeam team = given.checked(problem);
    std::vector<double> gains(problem.n_task, -kInfinity);
    std::vector<std::int32_t> places(problem.n_task, 0);
    FieldList list;
    list.uav = uav;
    for (std::size_t k = 0; k < order.size(); ++k) {
        const int task = order.data()[k];
        if (task < 0 || task >= problem.n_task) refuse("order must hold indices of tasks");
        list.order.push_back(item_of_task(task, 0));
    }
    {
        const nb::gil_scoped_release released;
        std::uint64_t last_version = 0;
        Stays stays(problem, team, last_version);
        stand(problem, team, uav, stays);
        ListSolver solver(problem, team, last_version);
        if (std::isfinite(team.free_s[uav]) && solver.solve(list, stays, 0)) {
            for (int task = 0; task < problem.n_task; ++task) {
                if (!wanted.data()[task]) continue;
                bool ignored = false;
                const ItemInsertion best = solver.best_place(list, stays, task, ignored);
                gains[task] = best.gain;
                places[task] = static_cast<std::int32_t>(best.place);
            }
        }
    }
    return {give(std::move(gains)), give(std::move(places))};
}

}  // namespace

void bind_field_insertion(nb::module_& module) {
    module.def(
        "field_best_insertions",
        [](const BoundField& problem, In<double, 1> free_s, In<double, 1> sortie_end_s,
           In<double, 2> first_s, In<double, 1> survived, In<bool, 1> active, In<bool, 1> open,
           In<std::int32_t, 1> landed_at, In<std::int64_t, 1> rank, In<double, 1> arrives_s,
           In<std::int32_t, 1> leaving, In<double, 1> leaves_s, int uav,
           In<std::int32_t, 1> order, In<bool, 1> wanted) {
            return best_insertions(problem,
                                   {free_s, sortie_end_s, first_s, survived, active, open,
                                    landed_at, rank, arrives_s, leaving, leaves_s},
                                   uav, order, wanted);
        },
        nb::arg("problem"), nb::arg("free_s").noconvert(), nb::arg("sortie_end_s").noconvert(),
        nb::arg("first_s").noconvert(), nb::arg("survived").noconvert(),
        nb::arg("active").noconvert(), nb::arg("open").noconvert(),
        nb::arg("landed_at").noconvert(), nb::arg("rank").noconvert(),
        nb::arg("arrives_s").noconvert(), nb::arg("leaving").noconvert(),
        nb::arg("leaves_s").noconvert(), nb::arg("uav"), nb::arg("order").noconvert(),
        nb::arg("wanted").noconvert());
}

}  // namespace peckorder
