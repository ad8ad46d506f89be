// The lower level (Fig. 1): UAVs decide one after another, each for itself.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "problem.hpp"
#include "rules.hpp"

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
    void clear() { waiting_.clear(); }
    void push(double free_s, std::int64_t rank, int uav);
    int pop();
    bool empty() const { return waiting_.empty(); }
    double next_free_s() const { return waiting_.front().free_s; }

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

    std::vector<Turn> waiting_;  // a binary heap
};

// Decide in the order of Fig. 1 until nobody has an open task it is capable of. Calls
// took(decider, choice, tied) for each decision; tied: another UAV waited that was free at the same
// time, and this one had decided before.
template <typename Took>
void simulate(const Problem& problem, const TeamView& team, const std::int64_t* rank, RuleCode rule,
              bool brief, Workspace& workspace, const Took& took) {
    struct Flying {
        Decider decider;
        std::int64_t rank;
        bool decided;
    };
    std::vector<Flying> fleet(static_cast<std::size_t>(problem.n_uav));
    Turns turns;
    for (int uav = 0; uav < problem.n_uav; ++uav) {
        fleet[static_cast<std::size_t>(uav)] = {team.decider(uav), rank[uav], false};
        if (team.active[uav] && std::isfinite(team.free_s[uav])) {
            turns.push(team.free_s[uav], rank[uav], uav);
        }
    }
    OpenTasks& open = workspace.open;
    open.assign(problem, team.open);
    while (!turns.empty() && !open.empty()) {
        Flying& next = fleet[static_cast<std::size_t>(turns.pop())];
        Decider& decider = next.decider;
        const Choice choice = workspace.decide(problem, open, decider, rule, brief);
        if (choice.task < 0) continue;  // tasks only close, so it has no further decision
        const bool tied = next.decided && !turns.empty() && turns.next_free_s() == decider.free_s;
        took(decider, choice, tied);
        next.decided = true;
        const std::size_t task = static_cast<std::size_t>(choice.task);
        decider.free_s = choice.completion_s;
        decider.place_m[0] = problem.x_m[task];
        decider.place_m[1] = problem.y_m[task];
        decider.place_m[2] = problem.z_m[task];
        decider.survived *= problem.survival[problem.cell(decider.uav, choice.task)];
        open.remove_task(choice.task);
        if (std::isfinite(decider.free_s)) turns.push(decider.free_s, next.rank, decider.uav);
    }
}

}  // namespace peckorder
