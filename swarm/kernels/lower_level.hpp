// The lower level (Fig. 1): UAVs decide one after another, each for itself.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "problem.hpp"
#include "rules.hpp"
#include "watch.hpp"

namespace peckorder {

// swarm.allocation.TeamState: where the team stands. The arrays belong to somebody else.
struct TeamView {
    const double* free_s;      // +infinity: decides nothing in this mission
    const double* place_m;     // 3 per UAV
    const double* survived;
    const std::uint8_t* open;  // per task
    const std::uint8_t* active;

    Decider decider(int uav) const {
        const double* place = place_m + 3 * uav;
        return {uav, free_s[uav], {place[0], place[1], place[2]}, survived[uav]};
    }
};

// Who decides next: free earliest, then first in the sequence, then smaller index.
class Turns {
  public:
    bool empty() const { return waiting_.empty(); }
    int next() const { return waiting_.front().uav; }

    void add(double free_s, std::int64_t rank, int uav) {
        waiting_.push_back({free_s, rank, uav});
        for (std::size_t at = waiting_.size() - 1; at > 0;) {
            const std::size_t above = (at - 1) / 2;
            if (!waiting_[at].before(waiting_[above])) break;
            std::swap(waiting_[at], waiting_[above]);
            at = above;
        }
    }

    // Whether another one waits that is free at the same time as the next.
    bool tied() const {
        const double free_s = waiting_.front().free_s;
        return (waiting_.size() > 1 && waiting_[1].free_s == free_s) ||
               (waiting_.size() > 2 && waiting_[2].free_s == free_s);
    }

    void put_off_next(double free_s) { settle({free_s, waiting_.front().rank, next()}); }

    void drop_next() {
        const Turn last = waiting_.back();
        waiting_.pop_back();
        if (!waiting_.empty()) settle(last);
    }

  private:
    struct Turn {
        double free_s;
        std::int64_t rank;
        int uav;
        bool before(const Turn& other) const {
            if (free_s != other.free_s) return free_s < other.free_s;
            return rank != other.rank ? rank < other.rank : uav < other.uav;
        }
    };

    // Put `turn` where the first one stood, and let it sink to its place.
    void settle(const Turn& turn) {
        const std::size_t n = waiting_.size();
        std::size_t at = 0;
        for (std::size_t below = 1; below < n; below = 2 * at + 1) {
            if (below + 1 < n && waiting_[below + 1].before(waiting_[below])) ++below;
            if (!waiting_[below].before(turn)) break;
            waiting_[at] = waiting_[below];
            at = below;
        }
        waiting_[at] = turn;
    }

    std::vector<Turn> waiting_;  // a binary heap
};

// About how many of a Watch's steps a decision among so many open tasks is.
inline std::int64_t steps_of_decision(RuleCode rule, std::size_t n_open) {
    constexpr std::int64_t kLooksPerStep = 4, kTable = 50'000, kLongTour = 1'500'000;
    if (rule == RuleCode::kGreedy) return static_cast<std::int64_t>(n_open) / kLooksPerStep + 1;
    return n_open > kExactTasks ? kLongTour : kTable;
}

// Decide in the order of Fig. 1 until nobody has an open task it is capable of. Calls
// took(decider, choice, tied) for each decision; tied: another UAV waited that was free at the same
// time, and this one had decided before. Told to stop, all decide greedily from then on, which takes
// no time to speak of; returns whether every decision was by the rule.
template <typename Took>
bool simulate(const Problem& problem, const TeamView& team, const std::int64_t* rank, RuleCode rule,
              bool brief, Workspace& workspace, Watch& watch, const Took& took) {
    struct Flying {
        Decider decider;
        bool decided;
    };
    std::vector<Flying> fleet(static_cast<std::size_t>(problem.n_uav()));
    Turns turns;
    for (int uav = 0; uav < problem.n_uav(); ++uav) {
        fleet[static_cast<std::size_t>(uav)] = {team.decider(uav), false};
        if (team.active[uav] && std::isfinite(team.free_s[uav])) {
            turns.add(team.free_s[uav], rank[uav], uav);
        }
    }
    OpenTasks& open = workspace.open;
    open.assign(problem, team.open);
    bool by_rule = true;
    while (!turns.empty() && !open.empty()) {
        if (by_rule && watch.stops_after(steps_of_decision(rule, open.size()))) {
            by_rule = false;
            rule = RuleCode::kGreedy;
            brief = true;
        }
        Flying& next = fleet[static_cast<std::size_t>(turns.next())];
        Decider& decider = next.decider;
        const Choice choice = workspace.decide(problem, open, decider, rule, brief);
        if (choice.task < 0) {
            turns.drop_next();  // tasks only close, so it has no further decision
            continue;
        }
        took(decider, choice, next.decided && turns.tied());
        next.decided = true;
        decider.free_s = choice.completion_s;
        std::copy_n(problem.place_m(choice.task), 3, decider.place_m);
        decider.survived *= problem.survivals(decider.uav)[choice.task];
        open.remove_task(choice.task);
        if (std::isfinite(decider.free_s)) {
            turns.put_off_next(decider.free_s);
        } else {
            turns.drop_next();
        }
    }
    return by_rule;
}

}  // namespace peckorder
