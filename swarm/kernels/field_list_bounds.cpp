// Bounds on what a list can be worth with a task more, which keep places from being valued in vain;
// see field_list.hpp.
//
// One kind goes by the earliest times of each task alone, the other by the battery: without windows the
// rest of a list takes the same time whenever it begins, so what it is worth falls by its slope with
// every second, and else depends on the charge alone: from the last task back, what each charge allows
// is a rising flight of steps.
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "field_list.hpp"

namespace peckorder {

namespace {
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kLong = 6;  // in shorter lists the battery is not worth bounds of its own,
constexpr std::size_t kVeryLong = 16;  // nor in these where they are no more than bounds
constexpr std::size_t kMostSteps = 24;
constexpr double kRounding = 1e-9;  // of values: the same
constexpr double kSlackS = 1e-5;  // sums in another order, and tolerances, must not refuse more

// Its times and value, but for where it is on a list.
OnList on_list(const FieldProblem& problem, int uav, int task) {
    OnList on{};
    on.work_s = problem.line_time_s(uav, item_of_task(task, 0));
    if (problem.is_line[task])
        on.work_s = std::min(on.work_s, problem.line_time_s(uav, item_of_task(task, 1)));
    on.work_s += problem.service_s[task];
    on.opens_s = problem.opens_s[task];
    on.last_s = std::min(problem.closes_s[task], problem.due_s[task] - on.work_s);
    on.until_s = problem.until_s[task];
    return on;
}

// Of the labels after so many tasks.
double earliest_s(const FieldList& list, std::size_t count) {
    double time_s = kInfinity;
    for (int k = list.offsets[count]; k < list.offsets[count + 1]; ++k)
        time_s = std::min(time_s, list.labels[k].progress.time_s);
    return time_s;
}

// Leave of steps those that rise, and few of them; whether these say all that they did.
bool keep_rising(std::vector<Charged>& steps) {
    std::sort(steps.begin(), steps.end(), [](const Charged& a, const Charged& b) {
        return a.need_s != b.need_s ? a.need_s < b.need_s : a.gain > b.gain;
    });
    std::size_t kept = 0;
    for (const Charged& step : steps) {
        if (kept == 0 || step.gain > steps[kept - 1].gain) steps[kept++] = step;
    }
    steps.resize(kept);
    if (kept <= kMostSteps) return true;
    // Of too many steps every second one is as high as the next: more than it is worth.
    while (steps.size() > kMostSteps) {
        kept = 0;
        for (std::size_t k = 0; k < steps.size(); k += 2) {
            const std::size_t next = std::min(k + 1, steps.size() - 1);
            steps[kept++] = {steps[k].need_s, steps[next].gain};
        }
        steps.resize(kept);
    }
    return false;
}
}  // namespace

double ListSolver::least_leg_s(int uav, int from, int to) const {
    double least_s = kInfinity;
    for (int way = 0; way <= problem_.is_line[from]; ++way) {
        const double* legs_s =
            problem_.legs_from(uav, problem_.leave_node(item_of_task(from, way)));
        for (int on = 0; on <= problem_.is_line[to]; ++on)
            least_s = std::min(least_s, legs_s[problem_.enter_node(item_of_task(to, on))]);
    }
    return least_s;
}

void ListSolver::learn(FieldList& list) {
    if (list.known == list.version) return;
    list.known = list.version;
    const std::size_t count = list.order.size();
    list.on.resize(count);
    double rest = 0.0, slope = 0.0;
    for (std::size_t k = count; k-- > 0;) {
        const int task = task_of(list.order[k]);
        OnList& on = list.on[k];
        on = on_list(problem_, list.uav, task);
        on.step_s = k == 0 ? 0.0 : least_leg_s(list.uav, task_of(list.order[k - 1]), task);
        on.end_s = earliest_s(list, k + 1);
        on.share = list.labels[list.offsets[k]].progress.survived *
                   problem_.weight[problem_.at(list.uav, task)];
        rest += on.share * (on.until_s - on.end_s);
        slope += on.share;
        on.rest = rest;
        on.slope = slope;
    }
    list.is_charged_exact = is_free(list);
    list.is_charged = swaps(list.uav) && count >= (list.is_charged_exact ? kLong : kVeryLong);
    if (list.is_charged) learn_charged(list);
}

// What the tasks from number `from` on can be worth at most if the first one of them is flown to
// so that it could begin at `time_s`, the chance to survive until then being so much less.
double ListSolver::most_value(const FieldList& list, std::size_t from, double time_s,
                              double survival) const {
    double value = 0.0;
    for (std::size_t k = from; k < list.order.size(); ++k) {
        const OnList& on = list.on[k];
        if (k > from) time_s += on.step_s;
        const double begin_s = std::max(time_s, on.opens_s);
        if (begin_s > on.last_s + kToleranceS) return -kInfinity;
        time_s = begin_s + on.work_s;
        if (time_s <= on.end_s) return value + survival * on.rest;
        value += survival * on.share * (on.until_s - time_s);
    }
    return value;
}

// At most so much is the list worth with `task` at that place; -infinity: it can't be done there.
double ListSolver::most_with(const FieldList& list, std::size_t place, int task) {
    const std::size_t pair = problem_.at(list.uav, task);
    const OnList on = on_list(problem_, list.uav, task);
    const int first = list.offsets[place], last = list.offsets[place + 1];
    double begin_s = kInfinity, value = -kInfinity;
    for (int k = first; k < last; ++k) {
        const Progress& progress = list.labels[k].progress;
        double leg_s = kInfinity;
        for (int way = 0; way <= problem_.is_line[task]; ++way)
            leg_s = std::min(leg_s, progress.legs_s[problem_.enter_node(item_of_task(task, way))]);
        begin_s = std::min(begin_s, progress.time_s + leg_s);
        value = std::max(value, progress.value);
    }
    begin_s = std::max(begin_s, on.opens_s);
    if (begin_s > on.last_s + kToleranceS) return -kInfinity;
    const double end_s = begin_s + on.work_s;
    value += list.labels[first].progress.survived * problem_.weight[pair] * (on.until_s - end_s);
    if (place < list.order.size()) {
        const double next_s = end_s + least_leg_s(list.uav, task, task_of(list.order[place]));
        value += most_value(list, place, next_s, problem_.survival[pair]);
    }
    return list.is_charged ? std::min(value, most_charged_with(list, place, task)) : value;
}

// The same by the battery, of each label at that place: into bound_. Whatever follows after `task`
// could follow before it, earlier by the detour at least and with as much more charge, as legs obey
// the triangle inequality.
double ListSolver::most_charged_with(const FieldList& list, std::size_t place, int task) {
    const std::size_t pair = problem_.at(list.uav, task);
    const int first = list.offsets[place], last = list.offsets[place + 1];
    const double share = list.labels[first].progress.survived * problem_.weight[pair];
    const double survival = problem_.survival[pair], until_s = problem_.until_s[task];
    const bool any_after = place < list.order.size();
    const double slope = any_after ? list.on[place].slope : 0.0;
    bound_.assign(last - first, -kInfinity);
    for (int way = 0; way <= problem_.is_line[task]; ++way) {
        const Item item = item_of_task(task, way);
        const int enter = problem_.enter_node(item);
        const double work_s = problem_.line_time_s(list.uav, item) + problem_.service_s[task];
        const double* onward_s = problem_.legs_from(list.uav, problem_.leave_node(item));
        double swapped_s = kInfinity;
        for (int base = 0; base < problem_.n_base && any_after; ++base) {
            const double* legs_s = problem_.legs_from(list.uav, problem_.base_node(base));
            const double detour_s = legs_s[enter] + work_s + longer_s(list, place, onward_s, legs_s);
            swapped_s = std::min(swapped_s, detour_s);
        }
        for (int k = first; k < last; ++k) {
            const Progress& now = list.labels[k].progress;
            const double arrive_s = now.time_s + now.legs_s[enter];
            const double end_s = std::max(arrive_s, problem_.opens_s[task]) + work_s;
            if (!std::isfinite(end_s) || list.rest[k] == -kInfinity) continue;
            double value = now.value + share * (until_s - end_s) + survival * list.rest[k];
            if (any_after) {
                const double direct_s =
                    end_s - now.time_s + longer_s(list, place, onward_s, now.legs_s);
                value -= survival * slope * std::max(0.0, std::min(direct_s, swapped_s));
            }
            bound_[k - first] = std::max(bound_[k - first], value);
        }
    }
    double most = -kInfinity;
    for (double& bound : bound_) {
        if (bound > -kInfinity) bound += kRounding * (std::abs(bound) + 1.0);
        most = std::max(most, bound);
    }
    return most;
}

// By how much the way to what follows is longer at least from one place than from another.
double ListSolver::longer_s(const FieldList& list, std::size_t to, const double* from_s,
                            const double* than_s) const {
    const int task = task_of(list.order[to]);
    double longer_s = kInfinity;
    const auto compare = [&](int node) {
        if (std::isfinite(from_s[node]) && std::isfinite(than_s[node]))
            longer_s = std::min(longer_s, from_s[node] - than_s[node]);
        else if (std::isfinite(from_s[node]))
            longer_s = -kInfinity;
    };
    for (int way = 0; way <= problem_.is_line[task]; ++way)
        compare(problem_.enter_node(item_of_task(task, way)));
    for (int base = 0; base < problem_.n_base; ++base) compare(problem_.base_node(base));
    return longer_s;
}

// Whether nothing but the battery keeps a list from being done whenever it begins.
bool ListSolver::is_free(const FieldList& list) const {
    for (int base = 0; base < problem_.n_base; ++base)
        if (problem_.slots[base] > 0 && problem_.slots[base] < problem_.n_uav) return false;
    return std::all_of(list.order.begin(), list.order.end(), [&](Item item) {
        const int task = task_of(item);
        return problem_.opens_s[task] <= 0.0 && problem_.closes_s[task] == kInfinity &&
               problem_.due_s[task] == kInfinity;
    });
}

// How long it takes at least from a base to be ready at another one, swaps at others between them.
void ListSolver::learn_hops(int uav) {
    const int kind = problem_.kind[uav], n_base = problem_.n_base;
    const double full_s = problem_.full_s[uav];
    if (hops_kind_ == kind && hops_full_s_ == full_s) return;
    hops_kind_ = kind;
    hops_full_s_ = full_s;
    const auto at = [&](int from, int to) -> double& {
        return hops_s_[static_cast<std::size_t>(from) * n_base + to];
    };
    for (int from = 0; from < n_base; ++from) {
        const double* legs_s = problem_.legs_from(uav, problem_.base_node(from));
        for (int to = 0; to < n_base; ++to) {
            const double leg_s = legs_s[problem_.base_node(to)];
            at(from, to) = leg_s <= full_s + kSlackS ? leg_s + problem_.swap_s[to] : kInfinity;
        }
        at(from, from) = 0.0;
    }
    for (int via = 0; via < n_base; ++via) {
        for (int from = 0; from < n_base; ++from) {
            for (int to = 0; to < n_base; ++to)
                at(from, to) = std::min(at(from, to), at(from, via) + at(via, to));
        }
    }
}

void ListSolver::learn_charged(FieldList& list) {
    learn_hops(list.uav);
    const int n_base = problem_.n_base;
    const std::size_t count = list.order.size();
    list.charged.clear();
    list.charged_offsets.assign(1, 0);
    list.from_base.assign(count * n_base, -kInfinity);
    unswapped_.assign(n_base, -kInfinity);
    for (std::size_t k = count; k-- > 0;) {
        const int task = task_of(list.order[k]);
        // What may follow it, by its directions.
        for (int way = 0; way < 2; ++way) {
            steps_.clear();
            if (k + 1 == count) {
                steps_.push_back({0.0, 0.0});
            } else if (way <= problem_.is_line[task]) {
                const Item item = item_of_task(task, way);
                const double* legs_s = problem_.legs_from(list.uav, problem_.leave_node(item));
                for_each_charged(list, k + 1, legs_s,
                                 [&](const Charged& one) { steps_.push_back(one); });
                list.is_charged_exact &= keep_rising(steps_);
            }
            list.charged.insert(list.charged.end(), steps_.begin(), steps_.end());
            list.charged_offsets.push_back(static_cast<int>(list.charged.size()));
        }
        // What it and those after it are worth behind a swap.
        const OnList& on = list.on[k];
        for (int base = 0; base < n_base; ++base) {
            const double* legs_s = problem_.legs_from(list.uav, problem_.base_node(base));
            unswapped_[base] = most_unswapped(list, k, legs_s, problem_.full_s[list.uav]);
        }
        for (int base = 0; base < n_base; ++base) {
            double most = -kInfinity;
            for (int last = 0; last < n_base; ++last) {
                const double hop_s = hops_s_[static_cast<std::size_t>(base) * n_base + last];
                if (std::isfinite(hop_s)) most = std::max(most, unswapped_[last] - on.slope * hop_s);
            }
            list.from_base[k * n_base + base] = most - on.slope * problem_.swap_s[base];
        }
    }
    // What follows each label.
    list.rest.clear();
    for (std::size_t place = 0; place <= count; ++place) {
        const double slope = place < count ? list.on[place].slope : 0.0;
        for (int k = list.offsets[place]; k < list.offsets[place + 1]; ++k) {
            const ListLabel& label = list.labels[k];
            const double left_s = charge_s(list.uav, label.progress);
            list.rest.push_back(place == 0
                                    ? most_from(list, 0, label.progress)
                                    : most_after(list, place - 1, label.item, left_s) -
                                          slope * label.progress.time_s);
        }
    }
}

// The steps behind task `number`, in that direction.
const Charged* ListSolver::charged_of(const FieldList& list, std::size_t number, int way,
                                      const Charged*& end) const {
    const std::size_t slot = 2 * (list.order.size() - 1 - number) + way;
    end = list.charged.data() + list.charged_offsets[slot + 1];
    return list.charged.data() + list.charged_offsets[slot];
}

// What the tasks from number `to` on may need of the battery, and be worth, from where `legs_s` begin.
template <typename Take>
void ListSolver::for_each_charged(const FieldList& list, std::size_t to, const double* legs_s,
                                  Take take) const {
    const OnList& on = list.on[to];
    const int task = task_of(list.order[to]);
    for (int way = 0; way <= problem_.is_line[task]; ++way) {
        const Item item = item_of_task(task, way);
        const double lasts_s = legs_s[problem_.enter_node(item)] +
                               problem_.line_time_s(list.uav, item) + problem_.service_s[task];
        const double home_s = problem_.home_time_s(list.uav, problem_.leave_node(item));
        if (!std::isfinite(lasts_s) || !std::isfinite(home_s)) continue;
        const double gain = on.share * on.until_s - on.slope * lasts_s;
        const Charged* end = nullptr;
        for (const Charged* one = charged_of(list, to, way, end); one != end; ++one)
            take(Charged{lasts_s + std::max(home_s, one->need_s), gain + one->gain});
    }
    for (int base = 0; base < problem_.n_base; ++base) {
        const double leg_s = legs_s[problem_.base_node(base)];
        const double gain = list.from_base[to * problem_.n_base + base] - on.slope * leg_s;
        if (std::isfinite(gain)) take(Charged{leg_s, gain});
    }
}

// At most so much are the tasks from number `to` on worth at time 0, the first of them flown to from
// where `legs_s` begin without another battery.
double ListSolver::most_unswapped(const FieldList& list, std::size_t to, const double* legs_s,
                                  double charge_s) const {
    const OnList& on = list.on[to];
    const int task = task_of(list.order[to]);
    double most = -kInfinity;
    for (int way = 0; way <= problem_.is_line[task]; ++way) {
        const Item item = item_of_task(task, way);
        const double lasts_s = legs_s[problem_.enter_node(item)] +
                               problem_.line_time_s(list.uav, item) + problem_.service_s[task];
        const double left_s = charge_s - lasts_s;
        if (!(left_s + kSlackS >= problem_.home_time_s(list.uav, problem_.leave_node(item))))
            continue;
        most = std::max(most, on.share * on.until_s - on.slope * lasts_s +
                                  most_after(list, to, item, left_s));
    }
    return most;
}

// At most so much are the tasks after number `number` worth, were it at time 0 that it has ended.
double ListSolver::most_after(const FieldList& list, std::size_t number, Item item,
                              double charge_s) const {
    const Charged* end = nullptr;
    const Charged* first = charged_of(list, number, backwards(item), end);
    while (end != first && (end - 1)->need_s > charge_s + kSlackS) --end;
    return end == first ? -kInfinity : (end - 1)->gain;
}

// At most so much are the tasks from number `from` on worth for who is where `now` says.
double ListSolver::most_from(const FieldList& list, std::size_t from, const Progress& now) const {
    if (from == list.order.size()) return 0.0;
    const OnList& on = list.on[from];
    const double left_s = charge_s(list.uav, now);
    double most = most_unswapped(list, from, now.legs_s, left_s);
    for (int base = 0; base < problem_.n_base; ++base) {
        const double leg_s = now.legs_s[problem_.base_node(base)];
        if (leg_s > left_s + kSlackS) continue;
        const double gain = list.from_base[from * problem_.n_base + base] - on.slope * leg_s;
        most = std::max(most, gain);
    }
    return most - on.slope * now.time_s;
}

}  // namespace peckorder
