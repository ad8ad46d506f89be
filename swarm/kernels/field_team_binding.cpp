// Python's way to schedules of a team's lists and to rules; see field_team.hpp, field_rules.hpp.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>

#include <cstddef>
#include <optional>
#include <tuple>
#include <vector>

#include "bindings.hpp"
#include "field_binding.hpp"
#include "field_rules.hpp"
#include "field_team.hpp"
#include "watch_binding.hpp"

namespace peckorder {

namespace {

using Size = std::size_t;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

FieldRule checked_rule(int code) {
    if (code < 0 || code > 3) {
        refuse("rule must be 0 (greedy), 1 (lookahead), 2 (nearest) or 3 (value per time)");
    }
    return static_cast<FieldRule>(code);
}

// Lists one after the other, cut at (n_uav + 1,) offsets; no task twice.
std::vector<ItemList> checked_lists(const FieldProblem& problem, const In<std::int32_t, 1>& flat,
                                    const In<std::int64_t, 1>& offsets) {
    require_shape("offsets", offsets, {static_cast<Size>(problem.n_uav) + 1});
    const auto count = static_cast<std::int64_t>(flat.shape(0));
    std::vector<std::uint8_t> seen(problem.n_task, 0);
    for (std::int64_t i = 0; i < count; ++i) {
        const Item item = flat.data()[i];
        if (item < -problem.n_base || item >= 2 * problem.n_task) {
            refuse("lists must hold items of the problem, not " + std::to_string(item));
        }
        if (is_base(item)) continue;
        if (seen[task_of(item)]) refuse("lists must hold no task twice");
        seen[task_of(item)] = 1;
    }
    const std::int64_t* at = offsets.data();
    if (at[0] != 0 || at[problem.n_uav] != count) refuse("offsets must go from 0 to the last item");
    std::vector<ItemList> lists;
    for (int uav = 0; uav < problem.n_uav; ++uav) {
        if (at[uav + 1] < at[uav] || at[uav + 1] > count) refuse("offsets must not decrease");
        lists.push_back({flat.data() + at[uav], static_cast<int>(at[uav + 1] - at[uav])});
    }
    return lists;
}

using Flown = std::tuple<Out<double, 2>, Out<std::int32_t, 1>, Out<std::int32_t, 1>,
                         Out<std::int32_t, 1>, Out<double, 2>, Out<double, 1>>;

Flown fly_lists(const BoundField& field, const BoundFieldTeam& given,
                const In<std::int32_t, 1>& flat, const In<std::int64_t, 1>& offsets) {
    const FieldProblem& problem = field.problem;
    const FieldTeam team = given.checked(problem);
    const std::vector<ItemList> lists = checked_lists(problem, flat, offsets);
    const Size n_uav = lists.size(), n_item = flat.shape(0);
    std::vector<double> times(4 * n_item, kNone), home_s, values;
    std::vector<std::int32_t> done, refusal, home;
    {
        const nb::gil_scoped_release released;
        TeamFlights flights;
        flights.fly(problem, team, lists.data());
        double* row = times.data();
        for (int uav = 0; uav < problem.n_uav; ++uav) {
            const FieldFlight& flight = flights.flight(uav);
            for (int index = 0; index < lists[uav].count; ++index, row += 4) {
                if (index >= flight.done) continue;
                const Times& at = flights.times(uav, index);
                row[0] = at.depart_s;
                row[1] = at.arrive_s;
                row[2] = at.begin_s;
                row[3] = at.end_s;
            }
            done.push_back(flight.done);
            refusal.push_back(static_cast<std::int32_t>(flight.refusal));
            home.push_back(flight.home);
            home_s.push_back(flight.done > 0 ? flight.home_depart_s : kNone);
            home_s.push_back(flight.done > 0 ? flight.home_arrive_s : kNone);
            values.push_back(flight.value());
        }
    }
    return {give<double, 2>(std::move(times), {n_item, 4}),
            give(std::move(done)),
            give(std::move(refusal)),
            give(std::move(home)),
            give<double, 2>(std::move(home_s), {n_uav, 2}),
            give(std::move(values))};
}

using Run = std::tuple<Out<std::int32_t, 1>, Out<std::int32_t, 1>, Out<double, 1>, Out<double, 2>,
                       Out<double, 2>>;

Run run_rule(const BoundField& field, const BoundFieldTeam& given, int rule_code, int first,
             nb::handle should_stop) {
    const FieldProblem& problem = field.problem;
    const FieldRule rule = checked_rule(rule_code);
    if (first < -1 || first >= problem.n_uav) refuse("first must be an index of a UAV, or -1");
    const FieldTeam team = given.checked(problem);
    FieldRun run;
    PythonWatch(should_stop).released(
        [&](Watch& watch) { run.run(problem, team, rule, watch, first); });
    std::vector<std::int32_t> uavs, items;
    std::vector<double> decided_s, times, scores;
    for (const FieldDecision& decision : run.decisions()) {
        const FieldChoice& choice = decision.choice;
        uavs.push_back(decision.uav);
        items.push_back(choice.item);
        decided_s.push_back(decision.decided_s);
        for (const double time_s : {choice.times.depart_s, choice.times.arrive_s,
                                    choice.times.begin_s, choice.times.end_s}) {
            times.push_back(time_s);
        }
        scores.push_back(choice.has_score ? choice.score : kNone);
        scores.push_back(choice.has_second ? choice.second : kNone);
    }
    const Size count = uavs.size();
    return {give(std::move(uavs)), give(std::move(items)), give(std::move(decided_s)),
            give<double, 2>(std::move(times), {count, 4}),
            give<double, 2>(std::move(scores), {count, 2})};
}

// Item, its four times, score and second best score; None: home.
using Fields = std::tuple<int, double, double, double, double, std::optional<double>,
                          std::optional<double>>;

std::optional<Fields> decide(const BoundField& field, const BoundFieldTeam& given, int uav,
                             int rule_code) {
    const FieldProblem& problem = field.problem;
    const FieldRule rule = checked_rule(rule_code);
    if (uav < 0 || uav >= problem.n_uav) refuse("uav must be an index of a UAV");
    const FieldTeam team = given.checked(problem, uav);
    if (!std::isfinite(team.free_s[uav])) return std::nullopt;
    std::vector<int> open;
    for (int task = 0; task < problem.n_task; ++task) {
        if (team.open[task]) open.push_back(task);
    }
    BaseTraffic traffic;
    traffic.reset(problem, team);
    const Progress progress = team.begin(problem, uav);
    FieldDecider decider;
    const FieldChoice choice = decider.decide(
        rule, {problem, open, uav, team.rank[uav], progress, team.landed_at[uav]}, traffic, Swaps::kNow);
    if (choice.home) return std::nullopt;
    const auto known = [](bool has, double score) {
        return has ? std::optional<double>(score) : std::nullopt;
    };
    const Times& times = choice.times;
    return Fields{choice.item,     times.depart_s, times.arrive_s,
                  times.begin_s,   times.end_s,    known(choice.has_score, choice.score),
                  known(choice.has_second, choice.second)};
}

}  // namespace

void bind_field_team(nb::module_& module) {
    using Floats = In<double, 1>;
    module.def(
        "field_fly_lists",
        [](const BoundField& problem, Floats free_s, Floats sortie_end_s, In<double, 2> first_s,
           Floats survived, In<bool, 1> active, In<bool, 1> open, In<std::int32_t, 1> landed_at,
           In<std::int64_t, 1> rank, Floats arrives_s, In<std::int32_t, 1> leaving, Floats leaves_s,
           In<std::int32_t, 1> flat, In<std::int64_t, 1> offsets) {
            return fly_lists(problem,
                             {free_s, sortie_end_s, first_s, survived, active, open, landed_at,
                              rank, arrives_s, leaving, leaves_s},
                             flat, offsets);
        },
        nb::arg("problem"), nb::arg("free_s").noconvert(), nb::arg("sortie_end_s").noconvert(),
        nb::arg("first_s").noconvert(), nb::arg("survived").noconvert(),
        nb::arg("active").noconvert(), nb::arg("open").noconvert(),
        nb::arg("landed_at").noconvert(), nb::arg("rank").noconvert(),
        nb::arg("arrives_s").noconvert(), nb::arg("leaving").noconvert(),
        nb::arg("leaves_s").noconvert(), nb::arg("flat").noconvert(), nb::arg("offsets").noconvert());
    module.def(
        "field_run_rule",
        [](const BoundField& problem, Floats free_s, Floats sortie_end_s, In<double, 2> first_s,
           Floats survived, In<bool, 1> active, In<bool, 1> open, In<std::int32_t, 1> landed_at,
           In<std::int64_t, 1> rank, Floats arrives_s, In<std::int32_t, 1> leaving, Floats leaves_s,
           int rule, int first, nb::handle should_stop) {
            return run_rule(problem,
                            {free_s, sortie_end_s, first_s, survived, active, open, landed_at,
                             rank, arrives_s, leaving, leaves_s},
                            rule, first, should_stop);
        },
        nb::arg("problem"), nb::arg("free_s").noconvert(), nb::arg("sortie_end_s").noconvert(),
        nb::arg("first_s").noconvert(), nb::arg("survived").noconvert(),
        nb::arg("active").noconvert(), nb::arg("open").noconvert(),
        nb::arg("landed_at").noconvert(), nb::arg("rank").noconvert(),
        nb::arg("arrives_s").noconvert(), nb::arg("leaving").noconvert(),
        nb::arg("leaves_s").noconvert(), nb::arg("rule"), nb::arg("first"),
        nb::arg("should_stop") = nb::none());
    module.def(
        "field_decide",
        [](const BoundField& problem, Floats free_s, Floats sortie_end_s, In<double, 2> first_s,
           Floats survived, In<bool, 1> active, In<bool, 1> open, In<std::int32_t, 1> landed_at,
           In<std::int64_t, 1> rank, Floats arrives_s, In<std::int32_t, 1> leaving, Floats leaves_s,
           int uav, int rule) {
            return decide(problem,
                          {free_s, sortie_end_s, first_s, survived, active, open, landed_at, rank,
                           arrives_s, leaving, leaves_s},
                          uav, rule);
        },
        nb::arg("problem"), nb::arg("free_s").noconvert(), nb::arg("sortie_end_s").noconvert(),
        nb::arg("first_s").noconvert(), nb::arg("survived").noconvert(),
        nb::arg("active").noconvert(), nb::arg("open").noconvert(),
        nb::arg("landed_at").noconvert(), nb::arg("rank").noconvert(),
        nb::arg("arrives_s").noconvert(), nb::arg("leaving").noconvert(),
        nb::arg("leaves_s").noconvert(), nb::arg("uav"), nb::arg("rule"));
}

}  // namespace peckorder
