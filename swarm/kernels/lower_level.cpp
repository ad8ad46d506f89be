// Single decisions, runs of the lower level, and batches of them; see lower_level.hpp.
#include "lower_level.hpp"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <optional>
#include <tuple>

#include "arrays.hpp"
#include "bindings.hpp"
#include "parallel.hpp"
#include "watch_binding.hpp"

namespace peckorder {

namespace {

using Size = std::size_t;

// Larger missions let other Python threads run meanwhile; a decision of smaller ones is over sooner
// than the lock can be handed over.
constexpr int kBriefTasks = 2048;

constexpr std::int64_t kUndone = -2;  // all along a row of first_rounds

class Lease {  // a workspace for one scope
  public:
    explicit Lease(const Problem& problem)
        : problem_(problem), workspace_(problem.borrow_workspace()) {}
    Lease(Lease&& other) = default;
    ~Lease() {
        if (workspace_) problem_.return_workspace(std::move(workspace_));
    }
    Workspace& operator*() const { return *workspace_; }

  private:
    const Problem& problem_;
    std::unique_ptr<Workspace> workspace_;
};

RuleCode checked_rule(int code) {
    if (code != 0 && code != 1) refuse("rule must be 0 (greedy) or 1 (lookahead)");
    return static_cast<RuleCode>(code);
}

struct Team {  // as Python passes it
    In<double, 1> free_s;
    In<double, 2> place_enu_m;
    In<double, 1> survived;
    In<bool, 1> open;
    In<bool, 1> active;

    TeamView checked(const Problem& problem) const {
        const Size n_uav = static_cast<Size>(problem.n_uav());
        require_shape("free_s", free_s, {n_uav});
        require_shape("place_enu_m", place_enu_m, {n_uav, 3});
        require_shape("survived", survived, {n_uav});
        require_shape("open", open, {static_cast<Size>(problem.n_task())});
        require_shape("active", active, {n_uav});
        for (Size i = 0; i < n_uav; ++i) {
            if (!(free_s.data()[i] > -HUGE_VAL)) {
                refuse("free_s must be times, not NaN or -infinity");
            }
            require_within("survived", survived.data()[i], 0.0, 1.0, "within 0..1");
        }
        require_finite("place_enu_m", place_enu_m.data(), 3 * n_uav);
        return {free_s.data(), place_enu_m.data(), survived.data(), bytes_of(open),
                bytes_of(active)};
    }
};

// The decision of one UAV whose turn it is, as the fields of swarm.allocation.Decision; or None.
using Fields = std::tuple<int, int, double, double, double, std::optional<double>, bool, bool>;

// Decide, and let `look` see the workspace before another decision borrows it; false: no decision.
template <typename Look>
bool decide_once(const Problem& problem, const In<double, 1>& free_s,
                 const In<double, 2>& place_enu_m, const In<double, 1>& survived,
                 const In<bool, 1>& open, int uav, int rule_code, const Look& look) {
    const RuleCode rule = checked_rule(rule_code);
    if (uav < 0 || uav >= problem.n_uav()) refuse("uav must be an index of a UAV");
    const Size n_uav = static_cast<Size>(problem.n_uav());
    require_shape("free_s", free_s, {n_uav});
    require_shape("place_enu_m", place_enu_m, {n_uav, 3});
    require_shape("survived", survived, {n_uav});
    require_shape("open", open, {static_cast<Size>(problem.n_task())});
    const TeamView team{free_s.data(), place_enu_m.data(), survived.data(), bytes_of(open), nullptr};
    const Decider decider = team.decider(uav);
    if (!(decider.free_s > -HUGE_VAL)) refuse("free_s must be a time, not NaN or -infinity");
    if (decider.free_s == HUGE_VAL) return false;
    require_finite("place_enu_m", decider.place_m, 3);
    require_within("survived", decider.survived, 0.0, 1.0, "within 0..1");
    Choice choice;
    {
        const Lease lease(problem);
        auto work = [&] {
            Workspace& workspace = *lease;
            workspace.open.assign(problem, team.open);
            choice = workspace.decide(problem, workspace.open, decider, rule, false);
            if (choice.task >= 0) look(decider, choice, workspace);
        };
        if (rule == RuleCode::kGreedy && problem.n_task() < kBriefTasks) {
            work();
        } else {
            nb::gil_scoped_release released;
            work();
        }
    }
    return choice.task >= 0;
}

std::optional<Fields> decide(const Problem& problem, In<double, 1> free_s,
                             In<double, 2> place_enu_m, In<double, 1> survived, In<bool, 1> open,
                             int uav, int rule_code) {
    Fields fields;
    const bool decided = decide_once(
        problem, free_s, place_enu_m, survived, open, uav, rule_code,
        [&](const Decider& decider, const Choice& choice, const Workspace&) {
            std::optional<double> second;
            if (choice.has_second) second = choice.second;
            fields = {uav,          choice.task, decider.free_s,     choice.completion_s,
                      choice.score, second,      choice.certificate, choice.exact};
        });
    return decided ? std::optional<Fields>(fields) : std::nullopt;
}

std::vector<std::pair<int, double>> valued(const Problem& problem, In<double, 1> free_s,
                                           In<double, 2> place_enu_m, In<double, 1> survived,
                                           In<bool, 1> open, int uav, int rule_code, int most) {
    if (most < 1) refuse("most must be >= 1");
    std::vector<std::pair<int, double>> found;
    decide_once(problem, free_s, place_enu_m, survived, open, uav, rule_code,
                [&](const Decider&, const Choice& choice, const Workspace& workspace) {
                    found = workspace.valued(choice, static_cast<Size>(most));
                });
    return found;
}

using Run = std::tuple<Out<std::int64_t, 1>, Out<std::int64_t, 1>, Out<double, 1>, Out<double, 1>>;

Run run(const Problem& problem, const Team& team, In<std::int64_t, 1> rank, int rule_code,
        nb::handle should_stop) {
    const RuleCode rule = checked_rule(rule_code);
    const TeamView view = team.checked(problem);
    require_shape("rank", rank, {static_cast<Size>(problem.n_uav())});
    std::vector<std::int64_t> uavs, tasks;
    std::vector<double> completion_s, scores;
    PythonWatch(should_stop).released([&](Watch& watch) {
        const Lease lease(problem);
        simulate(problem, view, rank.data(), rule, true, *lease, watch,
                 [&](const Decider& decider, const Choice& choice, bool) {
                     uavs.push_back(decider.uav);
                     tasks.push_back(choice.task);
                     completion_s.push_back(choice.completion_s);
                     scores.push_back(choice.score);
                 });
    });
    return {give(std::move(uavs)), give(std::move(tasks)), give(std::move(completion_s)),
            give(std::move(scores))};
}

struct Sequences {
    In<std::int64_t, 2> rank;
    int threads;

    Size checked(const Problem& problem) const {
        const Size count = rank.shape(0);
        require_shape("rank", rank, {count, static_cast<Size>(problem.n_uav())});
        if (threads < 1 || threads > 1024) refuse("threads must be within 1..1024");
        return count;
    }
};

Out<bool, 1> give_flags(std::vector<std::uint8_t>&& values) {
    const Size count = values.size();
    auto* kept = new std::vector<std::uint8_t>(std::move(values));
    nb::capsule owner(kept, [](void* p) noexcept {
        delete static_cast<std::vector<std::uint8_t>*>(p);
    });
    return Out<bool, 1>(kept->data(), {count}, owner);
}

using Runs = std::tuple<Out<double, 1>, Out<bool, 1>, Out<bool, 1>, Out<std::int64_t, 2>,
                        Out<std::int64_t, 2>>;

// Told to stop, it ends those under way greedily and begins no other, but always the first.
Runs run_sequences(const Problem& problem, const Team& team, const Sequences& sequences,
                   int rule_code, nb::handle should_stop) {
    const RuleCode rule = checked_rule(rule_code);
    const TeamView view = team.checked(problem);
    const Size count = sequences.checked(problem), n_uav = static_cast<Size>(problem.n_uav());
    const Size n_task = static_cast<Size>(problem.n_task());
    std::vector<double> objectives(count, std::numeric_limits<double>::quiet_NaN());
    std::vector<std::uint8_t> tied(count, 0), whole(count, 0);
    std::vector<std::int64_t> uavs(count * n_task, -1), tasks(count * n_task, -1);
    PythonWatch(should_stop).released([&](Watch& watch) {
        parallel_for(count, sequences.threads, 1, [&] {
            return [&, lease = Lease(problem)](Size job) {
                if (job > 0 && watch.stopped()) return;
                double objective = 0.0;
                bool any_tie = false;
                Size at = job * n_task;
                whole[job] = simulate(
                    problem, view, sequences.rank.data() + job * n_uav, rule, true, *lease, watch,
                    [&](const Decider& decider, const Choice& choice, bool tie) {
                        const double weight = problem.weights(decider.uav)[choice.task];
                        const double left_s = problem.horizon_s() - choice.completion_s;
                        objective += (decider.survived * weight) * left_s;
                        any_tie = any_tie || tie;
                        uavs[at] = decider.uav;
                        tasks[at++] = choice.task;
                    });
                objectives[job] = objective;
                tied[job] = any_tie;
            };
        });
    });
    const Size shape[2] = {count, n_task};
    return {give(std::move(objectives)), give_flags(std::move(tied)), give_flags(std::move(whole)),
            give<std::int64_t, 2>(std::move(uavs), shape),
            give<std::int64_t, 2>(std::move(tasks), shape)};
}

// What each UAV takes first when all decide once, in the order of their ranks alone; told to stop, it
// leaves rows undone.
Out<std::int64_t, 2> first_rounds(const Problem& problem, const Team& team,
                                  const Sequences& sequences, int rule_code,
                                  nb::handle should_stop) {
    const RuleCode rule = checked_rule(rule_code);
    const TeamView view = team.checked(problem);
    const Size count = sequences.checked(problem), n_uav = static_cast<Size>(problem.n_uav());
    std::vector<std::int64_t> tasks(count * n_uav, kUndone);
    PythonWatch(should_stop).released([&](Watch& watch) {
        parallel_for(count, sequences.threads, 16, [&] {
            using Place = std::pair<std::int64_t, int>;  // rank, then UAV
            return [&, lease = Lease(problem), order = std::vector<Place>()](Size job) mutable {
                if (watch.stopped()) return;
                const std::int64_t* rank = sequences.rank.data() + job * n_uav;
                order.clear();
                for (int uav = 0; uav < problem.n_uav(); ++uav) {
                    if (view.active[uav] && std::isfinite(view.free_s[uav])) {
                        order.emplace_back(rank[uav], uav);
                    }
                }
                std::sort(order.begin(), order.end());
                std::vector<std::int64_t> row(n_uav, -1);
                Workspace& workspace = *lease;
                OpenTasks& open = workspace.open;
                open.assign(problem, view.open);
                for (const auto& [place, uav] : order) {
                    (void)place;
                    if (watch.stops_after(steps_of_decision(rule, open.size()))) return;
                    const Choice choice =
                        workspace.decide(problem, open, view.decider(uav), rule, true);
                    if (choice.task < 0) continue;
                    row[static_cast<Size>(uav)] = choice.task;
                    open.remove_task(choice.task);
                }
                std::copy(row.begin(), row.end(),
                          tasks.begin() + static_cast<std::ptrdiff_t>(job * n_uav));
            };
        });
    });
    return give<std::int64_t, 2>(std::move(tasks), {count, n_uav});
}

}  // namespace

void bind_lower_level(nb::module_& module) {
    module.attr("EXACT_TASKS") = kExactTasks;
    module.def("decide", &decide, nb::arg("problem"), nb::arg("free_s").noconvert(), nb::arg("place_enu_m").noconvert(),
               nb::arg("survived").noconvert(), nb::arg("open").noconvert(), nb::arg("uav"), nb::arg("rule"));
    module.def("valued", &valued, nb::arg("problem"), nb::arg("free_s").noconvert(), nb::arg("place_enu_m").noconvert(),
               nb::arg("survived").noconvert(), nb::arg("open").noconvert(), nb::arg("uav"), nb::arg("rule"), nb::arg("most"));
    module.def(
        "run",
        [](const Problem& problem, In<double, 1> free_s, In<double, 2> place_enu_m,
           In<double, 1> survived, In<bool, 1> open, In<bool, 1> active, In<std::int64_t, 1> rank,
           int rule, nb::handle should_stop) {
            return run(problem, {free_s, place_enu_m, survived, open, active}, rank, rule,
                       should_stop);
        },
        nb::arg("problem"), nb::arg("free_s").noconvert(), nb::arg("place_enu_m").noconvert(), nb::arg("survived").noconvert(),
        nb::arg("open").noconvert(), nb::arg("active").noconvert(), nb::arg("rank").noconvert(), nb::arg("rule"),
        nb::arg("should_stop") = nb::none());
    module.def(
        "run_sequences",
        [](const Problem& problem, In<double, 1> free_s, In<double, 2> place_enu_m,
           In<double, 1> survived, In<bool, 1> open, In<bool, 1> active, In<std::int64_t, 2> rank,
           int rule, int threads, nb::handle should_stop) {
            return run_sequences(problem, {free_s, place_enu_m, survived, open, active},
                                 {rank, threads}, rule, should_stop);
        },
        nb::arg("problem"), nb::arg("free_s").noconvert(), nb::arg("place_enu_m").noconvert(), nb::arg("survived").noconvert(),
        nb::arg("open").noconvert(), nb::arg("active").noconvert(), nb::arg("rank").noconvert(), nb::arg("rule"), nb::arg("threads"),
        nb::arg("should_stop") = nb::none());
    module.def(
        "first_rounds",
        [](const Problem& problem, In<double, 1> free_s, In<double, 2> place_enu_m,
           In<double, 1> survived, In<bool, 1> open, In<bool, 1> active, In<std::int64_t, 2> rank,
           int rule, int threads, nb::handle should_stop) {
            return first_rounds(problem, {free_s, place_enu_m, survived, open, active},
                                {rank, threads}, rule, should_stop);
        },
        nb::arg("problem"), nb::arg("free_s").noconvert(), nb::arg("place_enu_m").noconvert(), nb::arg("survived").noconvert(),
        nb::arg("open").noconvert(), nb::arg("active").noconvert(), nb::arg("rank").noconvert(), nb::arg("rule"), nb::arg("threads"),
        nb::arg("should_stop") = nb::none());
}

}  // namespace peckorder
