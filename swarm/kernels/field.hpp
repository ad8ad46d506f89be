// The field's problem as the kernels see it: windows, due times, lines, energy, bases; times of legs
// as tables (swarm.allocation.field.FieldProblem, checked there and kept alive by the binding).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace peckorder {

// What a list holds: task k from its first point on is 2k, from its last point on 2k + 1; base b is
// -1 - b.
using Item = std::int32_t;

inline bool is_base(Item item) { return item < 0; }
inline int base_of(Item item) { return -1 - item; }
inline int task_of(Item item) { return item >> 1; }
inline int backwards(Item item) { return item & 1; }
inline Item item_of_base(int base) { return -1 - base; }
inline Item item_of_task(int task, int backwards) { return 2 * task + backwards; }

// All limits are inclusive, with this tolerance.
constexpr double kToleranceS = 1e-6;

// Why an item can't be next on a list.
enum class Refusal : std::int8_t { kNone, kIncapable, kNoWay, kWindow, kDue, kEnergy };

// The arrays of FieldProblem, C-contiguous; infinity stands for what there is no limit to.
struct FieldProblem {
    int n_uav, n_base, n_task, n_node, n_kind;
    double horizon_s;
    const std::int32_t* kind;         // (n_uav,) row of the tables of legs
    const double* leg_s;              // (n_kind, n_node, n_node); infinity: no way
    const double* line_s;             // (n_kind, n_task, 2) along the task, forwards and backwards
    const std::int32_t* enter;        // (n_task, 2) node where it begins, forwards and backwards
    const double* home_s;             // (n_uav, n_node) to the nearest of the bases and its own start
    const std::int32_t* home;         // (n_uav, n_node) which that is: a base, or -1 for the start
    const std::uint8_t* is_line;      // (n_task,) whether the direction matters
    const double* service_s;          // (n_task,)
    const double* opens_s;            // (n_task,)
    const double* closes_s;           // (n_task,)
    const double* due_s;              // (n_task,)
    const double* until_s;            // (n_task,) due_s, else D: what its end is subtracted from
    const std::uint8_t* required;     // (n_task,) it has no due_s
    const double* weight;             // (n_uav, n_task) p·m; see `capable`
    const double* survival;           // (n_uav, n_task)
    const std::uint8_t* capable;      // (n_uav, n_task) p > 0
    const double* full_s;             // (n_uav,) airborne time of a sortie after a swap
    const double* land_s;             // (n_uav,) of the times of legs to bases, the landing
    const double* swap_s;             // (n_base,)
    const std::int32_t* slots;        // (n_base,); 0: no limit

    int base_node(int base) const { return n_uav + base; }
    int enter_node(Item item) const { return enter[2 * task_of(item) + backwards(item)]; }
    int leave_node(Item item) const { return enter[2 * task_of(item) + 1 - backwards(item)]; }

    const double* legs_from(int uav, int node) const {
        const std::size_t row = static_cast<std::size_t>(kind[uav]) * n_node + node;
        return leg_s + row * n_node;
    }
    double line_time_s(int uav, Item item) const {
        const std::size_t row = static_cast<std::size_t>(kind[uav]) * n_task + task_of(item);
        return line_s[2 * row + backwards(item)];
    }
    double home_time_s(int uav, int node) const {
        return home_s[static_cast<std::size_t>(uav) * n_node + node];
    }
    std::size_t at(int uav, int task) const {
        return static_cast<std::size_t>(uav) * n_task + task;
    }
};

// How far a UAV has come in its list, and is free.
struct Progress {
    double time_s = 0.0;
    double sortie_end_s = std::numeric_limits<double>::infinity();  // by then it has landed
    const double* legs_s = nullptr;  // (n_node,) from where it is to every node
    bool landed = false;             // after a swap; the next sortie begins with its departure
    double survived = 1.0;           // S of eq. 1 of its next task
    double value = 0.0;              // of eq. 1 so far
};

// The times of one item of a schedule.
struct Times {
    double depart_s, arrive_s, begin_s, end_s;
};

// Let `uav` do the next item, a task, or say why it can't; then `progress` stays as it was.
inline Refusal do_task(const FieldProblem& problem, int uav, Item item, Progress& progress,
                       Times& times) {
    const int task = task_of(item);
    const std::size_t pair = problem.at(uav, task);
    if (!problem.capable[pair]) return Refusal::kIncapable;
    const double leg_s = progress.legs_s[problem.enter_node(item)];
    const double line_s = problem.line_time_s(uav, item);
    if (!std::isfinite(leg_s) || !std::isfinite(line_s)) return Refusal::kNoWay;
    const double opens_s = problem.opens_s[task];
    const double depart_s =
        progress.landed ? std::max(progress.time_s, opens_s - leg_s) : progress.time_s;
    const double arrive_s = depart_s + leg_s;
    const double begin_s = std::max(arrive_s, opens_s);
    if (begin_s > problem.closes_s[task] + kToleranceS) return Refusal::kWindow;
    const double end_s = (begin_s + line_s) + problem.service_s[task];
    if (end_s > problem.due_s[task] + kToleranceS) return Refusal::kDue;
    const double sortie_end_s =
        progress.landed ? depart_s + problem.full_s[uav] : progress.sortie_end_s;
    const int leaves = problem.leave_node(item);
    const double home_s = problem.home_time_s(uav, leaves);
    if (!std::isfinite(home_s)) return Refusal::kNoWay;
    if (end_s + home_s > sortie_end_s + kToleranceS) return Refusal::kEnergy;
    times = {depart_s, arrive_s, begin_s, end_s};
    progress.value += (progress.survived * problem.weight[pair]) * (problem.until_s[task] - end_s);
    progress.survived *= problem.survival[pair];
    progress.time_s = end_s;
    progress.sortie_end_s = sortie_end_s;
    progress.legs_s = problem.legs_from(uav, leaves);
    progress.landed = false;
    return Refusal::kNone;
}

// When `uav` would stand at a base where a slot is free; infinity: there is no way.
inline double arrival_s(const FieldProblem& problem, int base, const Progress& progress) {
    return progress.time_s + progress.legs_s[problem.base_node(base)];
}

// When `uav`, whose leg to a base would end on its ground at `arrive_s`, touches down there if a slot
// is free from `slot_s` on: it waits for that in the air, before it lands.
inline double touch_down_s(const FieldProblem& problem, int uav, double arrive_s, double slot_s) {
    return std::max(arrive_s, slot_s + problem.land_s[uav]);
}

// Let `uav`, which departs at once, land at `base` at `begin_s`, when there is a slot for it, or say
// why it can't.
inline Refusal swap_battery(const FieldProblem& problem, int uav, int base, double begin_s,
                            Progress& progress, Times& times) {
    const double arrive_s = arrival_s(problem, base, progress);
    if (!std::isfinite(arrive_s)) return Refusal::kNoWay;
    const double sortie_end_s =
        progress.landed ? progress.time_s + problem.full_s[uav] : progress.sortie_end_s;
    if (begin_s > sortie_end_s + kToleranceS) return Refusal::kEnergy;
    const double ready_s = begin_s + problem.swap_s[base];
    times = {progress.time_s, arrive_s, begin_s, ready_s};
    progress.time_s = ready_s;
    progress.sortie_end_s = std::numeric_limits<double>::infinity();
    progress.legs_s = problem.legs_from(uav, problem.base_node(base));
    progress.landed = true;
    return Refusal::kNone;
}

// The same where slots are no concern.
inline Refusal do_item(const FieldProblem& problem, int uav, Item item, Progress& progress,
                       Times& times) {
    if (!is_base(item)) return do_task(problem, uav, item, progress, times);
    const int base = base_of(item);
    return swap_battery(problem, uav, base, arrival_s(problem, base, progress), progress, times);
}

// Where each UAV begins; swarm.allocation.field.FieldState.
struct FieldTeam {
    const double* free_s;            // (n_uav,)
    const double* sortie_end_s;      // (n_uav,)
    const double* first_s;           // (n_uav, n_node) legs from where it is then
    const double* survived;          // (n_uav,)
    const std::uint8_t* active;      // (n_uav,)
    const std::uint8_t* open;        // (n_task,)
    const std::int32_t* landed_at;   // (n_uav,) base at which it stands ready when it is free; or -1
    const std::int64_t* rank;        // (n_uav,) place in the sequence
    const double* arrives_s = nullptr;  // (n_uav,) above that base: -infinity, it stands on a slot;
                                        // infinity, beside the slots. Null: all stand on slots
    const std::int32_t* leaving = nullptr;  // (n_uav,) base on a slot of which it waits for its
                                            // departure to what it does before it is free; or -1
    const double* leaves_s = nullptr;       // (n_uav,) when that is

    Progress begin(const FieldProblem& problem, int uav) const {
        Progress progress;
        progress.time_s = free_s[uav];
        progress.sortie_end_s = sortie_end_s[uav];
        progress.legs_s = first_s + static_cast<std::size_t>(uav) * problem.n_node;
        progress.landed = landed_at[uav] >= 0;
        progress.survived = survived[uav];
        return progress;
    }

    // Whether it has yet to find a slot at the base where it is to stand.
    bool is_bound(int uav) const {
        return landed_at[uav] >= 0 && arrives_s != nullptr && std::isfinite(arrives_s[uav]);
    }
    bool stands_on_slot(int uav) const {
        return landed_at[uav] >= 0 &&
               (arrives_s == nullptr ||
                arrives_s[uav] == -std::numeric_limits<double>::infinity());
    }
    int leaving_base(int uav) const { return leaving == nullptr ? -1 : leaving[uav]; }

    // Of who has yet to find a slot: above that base.
    Progress above_base(const FieldProblem& problem, int uav) const {
        Progress progress = begin(problem, uav);
        progress.time_s = arrives_s[uav];
        progress.legs_s = problem.legs_from(uav, problem.base_node(landed_at[uav]));
        progress.landed = false;
        return progress;
    }
};

}  // namespace peckorder
