// Teams that decide item by item; see field_rules.hpp.
#include "field_rules.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace peckorder {

namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr int kMostRuns = 200;
constexpr double kShortestS = 1e-9;  // a task on the spot without service comes before all others

// Of some ten nanoseconds, about as many as a decision takes.
std::int64_t steps_of(FieldRule rule, std::size_t n_open) {
    return static_cast<std::int64_t>(n_open) * (rule == FieldRule::kLookahead ? 10'000 : 2);
}

// What the rule makes of a task done at these times; the largest is taken.
double score_of(FieldRule rule, const Progress& before, double weight, double until_s,
                const Times& times) {
    if (rule == FieldRule::kNearest) return before.time_s - times.begin_s;
    if (rule == FieldRule::kValuePerTime) {
        return weight / std::max(times.end_s - before.time_s, kShortestS);
    }
    return (before.survived * weight) * (until_s - times.end_s);
}

}  // namespace

void BaseTraffic::reset(const FieldProblem& problem, const FieldTeam& team) {
    clear(problem);
    for (int base = 0; base < problem.n_base; ++base) {
        const int slots = problem.slots[base];
        if (slots < problem.n_uav) limit_[base] = slots;  // more are as good as no limit
    }
    for (int uav = 0; uav < problem.n_uav; ++uav) {
        const int leaving = team.leaving_base(uav);
        if (leaving >= 0 && limited(leaving)) hold(uav, leaving, team.leaves_s[uav]);
        const int base = team.landed_at[uav];
        if (base < 0 || !limited(base)) continue;
        if (team.stands_on_slot(uav)) {
            hold(uav, base, team.active[uav] ? team.free_s[uav] : kNever);
        } else if (team.is_bound(uav) && team.active[uav]) {
            approach(uav, base, {team.arrives_s[uav], team.rank[uav], uav},
                     team.sortie_end_s[uav]);
        }
    }
}

void BaseTraffic::clear(const FieldProblem& problem) {
    at_.assign(problem.n_uav, At{});
    held_.assign(problem.n_base, 0);
    limit_.assign(problem.n_base, 0);
    left_s_.resize(problem.n_base);
    for (std::vector<double>& left_s : left_s_) left_s.clear();
}

void BaseTraffic::approach(int uav, int base, const Arrival& arrival, double sortie_end_s) {
    at_[uav] = At{Stage::kApproaching, base, 0.0, arrival, sortie_end_s};
}

void BaseTraffic::hold(int uav, int base, double until_s) {
    at_[uav] = At{Stage::kHolding, base, until_s, Arrival{}, 0.0};
    ++held_[base];
}

void BaseTraffic::leave(int uav) {
    --held_[at_[uav].base];
    left_s_[at_[uav].base].push_back(at_[uav].until_s);
    at_[uav].stage = Stage::kElsewhere;
}

// Since when slots of a base are free: who comes takes the one that is so for longest, so those that
// are free now were left last, or never held.
void BaseTraffic::find_free(int base) {
    const std::vector<double>& left_s = left_s_[base];
    const std::ptrdiff_t n_free = std::max(0, limit_[base] - held_[base]);
    const std::ptrdiff_t n_left = std::min(n_free, static_cast<std::ptrdiff_t>(left_s.size()));
    slot_s_.assign(n_free, -kNever);
    std::copy(left_s.end() - n_left, left_s.end(), slot_s_.begin());
}

double BaseTraffic::lands_s(const FieldProblem& problem, int uav) {
    find_free(at_[uav].base);
    const double slot_s = *std::min_element(slot_s_.begin(), slot_s_.end());
    return touch_down_s(problem, uav, at_[uav].arrival.arrive_s, slot_s);
}

double BaseTraffic::begin_s(const FieldProblem& problem, int base, const Arrival& arrival) {
    if (!limited(base)) return arrival.arrive_s;
    find_free(base);
    slot_s_.resize(limit_[base], -kNever);  // of those that are held it is told below
    const auto slot = [&]() -> double& {
        return *std::min_element(slot_s_.begin(), slot_s_.end());
    };
    ahead_.clear();
    for (int uav = 0; uav < problem.n_uav; ++uav) {
        const At& other = at_[uav];
        if (other.stage == Stage::kElsewhere || other.base != base) continue;
        if (other.stage == Stage::kHolding) {
            double& slot_s = slot();
            slot_s = std::max(slot_s, other.until_s);
        } else if (other.arrival < arrival) {
            ahead_.push_back(uav);
        }
    }
    std::sort(ahead_.begin(), ahead_.end(),
              [&](int a, int b) { return at_[a].arrival < at_[b].arrival; });
    for (const int uav : ahead_) {
        double& slot_s = slot();
        const double begin_s = touch_down_s(problem, uav, at_[uav].arrival.arrive_s, slot_s);
        if (begin_s <= at_[uav].sortie_end_s + kToleranceS) slot_s = begin_s + problem.swap_s[base];
    }
    return touch_down_s(problem, arrival.uav, arrival.arrive_s, slot());
}

FieldChoice FieldDecider::decide(FieldRule rule, const FieldView& view, BaseTraffic& traffic,
                                 Swaps swaps) {
    if (rule == FieldRule::kLookahead) return lookahead(view, traffic, swaps);
    return by_score(rule, view, traffic, swaps);
}

FieldChoice FieldDecider::by_score(FieldRule rule, const FieldView& view, BaseTraffic& traffic,
                                   Swaps swaps) {
    const FieldChoice choice = task(rule, view);
    return choice.home && swaps == Swaps::kNow ? base(view, traffic) : choice;
}

// The first item of its own best list; where that is a base without a slot in time, greedy.
FieldChoice FieldDecider::lookahead(const FieldView& view, BaseTraffic& traffic, Swaps swaps) {
    const FieldProblem& problem = view.problem;
    const bool may_swap = swaps != Swaps::kNever;
    const OwnPlan& plan = own_list(view, may_swap);
    if (plan.list.empty()) return {};
    if (is_base(plan.list.front()) && swaps == Swaps::kLater) {
        return lookahead(view, traffic, Swaps::kNever);
    }
    FieldChoice choice{false, plan.list.front(), true, false, plan.value, 0.0, Times{}};
    Progress progress = view.progress;
    Refusal refusal = Refusal::kNone;
    if (is_base(choice.item)) {
        const int base = base_of(choice.item);
        const double arrive_s = arrival_s(problem, base, progress);
        const double begin_s = traffic.begin_s(problem, base, {arrive_s, view.rank, view.uav});
        refusal = begin_s < kNever ? swap_battery(problem, view.uav, base, begin_s, progress,
                                                  choice.times)
                                   : Refusal::kEnergy;
    } else {
        refusal = do_task(problem, view.uav, choice.item, progress, choice.times);
    }
    return refusal == Refusal::kNone ? choice : by_score(FieldRule::kGreedy, view, traffic, swaps);
}

bool FieldDecider::KnownPlan::answers(const FieldView& view, bool swaps) const {
    const Progress& now = view.progress;
    return uav == view.uav && here == view.here && may_swap == swaps &&
           progress.time_s == now.time_s && progress.sortie_end_s == now.sortie_end_s &&
           progress.legs_s == now.legs_s && progress.landed == now.landed &&
           progress.survived == now.survived && open == view.open;
}

// A run that is gone through anew from a barred visit on meets most of its questions again.
const OwnPlan& FieldDecider::own_list(const FieldView& view, bool may_swap) {
    const auto known = std::find_if(known_.begin(), known_.end(), [&](const KnownPlan& plan) {
        return plan.answers(view, may_swap);
    });
    if (known != known_.end()) return known->plan;
    OwnPlan plan = own_plan(view.problem, view.uav, view.progress, view.here, view.open, may_swap,
                            [&] { return greedy_list(view, may_swap); });
    known_.push_back(
        {view.uav, view.here, may_swap, view.progress, view.open, std::move(plan)});
    return known_.back().plan;
}

// What greedy would do next and next, alone.
std::vector<Item> FieldDecider::greedy_list(const FieldView& view, bool may_swap) {
    const FieldProblem& problem = view.problem;
    nobody_.clear(problem);
    std::vector<Item> list;
    std::vector<int> open = view.open;
    Progress progress = view.progress;
    int here = view.here, n_since_task = 0;
    while (!open.empty()) {
        const FieldChoice choice =
            by_score(FieldRule::kGreedy, {problem, open, view.uav, view.rank, progress, here}, nobody_,
                     may_swap && n_since_task < problem.n_base ? Swaps::kNow : Swaps::kNever);
        if (choice.home) break;
        Times times;
        if (do_item(problem, view.uav, choice.item, progress, times) != Refusal::kNone) break;
        list.push_back(choice.item);
        here = is_base(choice.item) ? base_of(choice.item) : -1;
        n_since_task = is_base(choice.item) ? n_since_task + 1 : 0;
        if (!is_base(choice.item)) {
            open.erase(std::lower_bound(open.begin(), open.end(), task_of(choice.item)));
        }
    }
    while (!list.empty() && is_base(list.back())) list.pop_back();
    return list;
}

FieldChoice FieldDecider::task(FieldRule rule, const FieldView& view) const {
    const FieldProblem& problem = view.problem;
    FieldChoice best;
    for (const int task : view.open) {
        FieldChoice found;  // the better direction of this task
        for (int backwards = 0; backwards <= problem.is_line[task]; ++backwards) {
            const Item item = item_of_task(task, backwards);
            Progress progress = view.progress;
            Times times;
            if (do_task(problem, view.uav, item, progress, times) != Refusal::kNone) continue;
            const double weight = problem.weight[problem.at(view.uav, task)];
            const double score =
                score_of(rule, view.progress, weight, problem.until_s[task], times);
            if (found.home || score > found.score) {
                found = {false, item, true, false, score, 0.0, times};
            }
        }
        if (found.home) continue;
        if (best.home || found.score > best.score) {
            found.has_second = !best.home;
            found.second = best.score;
            best = found;
        } else if (!best.has_second || found.score > best.second) {
            best.has_second = true;
            best.second = found.score;
        }
    }
    return best;
}

// Whether it could do a task next.
bool FieldDecider::opens_any(const FieldView& view, const Progress& progress) const {
    for (const int task : view.open) {
        for (int backwards = 0; backwards <= view.problem.is_line[task]; ++backwards) {
            Progress after = progress;
            Times times;
            const Item item = item_of_task(task, backwards);
            if (do_task(view.problem, view.uav, item, after, times) == Refusal::kNone) return true;
        }
    }
    return false;
}

// The base where it is ready earliest of those after which it could do a task; if there is none, the
// first on the way to such a one over others.
FieldChoice FieldDecider::base(const FieldView& view, BaseTraffic& traffic) {
    const FieldProblem& problem = view.problem;
    if (view.open.empty() || problem.full_s[view.uav] == kNever) return {};
    labels_.assign(problem.n_base, Label{});
    const auto reach = [&](const Progress& from, int to, Progress& progress, Times& times) {
        progress = from;
        const double arrive_s = arrival_s(problem, to, from);
        if (arrive_s == kNever) return false;
        const double begin_s = traffic.begin_s(problem, to, {arrive_s, view.rank, view.uav});
        return begin_s < kNever && swap_battery(problem, view.uav, to, begin_s, progress, times) ==
                                       Refusal::kNone;
    };
    const auto chosen = [&](int first_base, const Times& times) {
        return FieldChoice{false, item_of_base(first_base), false, false, 0.0, 0.0, times};
    };
    int nearest = -1;
    for (int base = 0; base < problem.n_base; ++base) {
        Label& label = labels_[base];
        if (base == view.here) {
            label.settled = true;  // there it stands already, as well off as it can be
            continue;
        }
        label.first_base = base;
        label.reached = reach(view.progress, base, label.progress, label.first);
        if (!label.reached) continue;
        if (nearest >= 0 && labels_[nearest].progress.time_s <= label.progress.time_s) continue;
        if (opens_any(view, label.progress)) nearest = base;
    }
    if (nearest >= 0) return chosen(nearest, labels_[nearest].first);
    while (true) {  // Dijkstra's: being ready earlier is never worse
        int next = -1;
        for (int base = 0; base < problem.n_base; ++base) {
            const Label& label = labels_[base];
            if (!label.reached || label.settled) continue;
            if (next < 0 || label.progress.time_s < labels_[next].progress.time_s) next = base;
        }
        if (next < 0) return {};
        Label& label = labels_[next];
        label.settled = true;
        if (label.first_base != next && opens_any(view, label.progress)) {
            return chosen(label.first_base, label.first);
        }
        for (int base = 0; base < problem.n_base; ++base) {
            Label& other = labels_[base];
            Progress progress;
            Times times;
            if (other.settled || !reach(label.progress, base, progress, times)) continue;
            if (other.reached && other.progress.time_s <= progress.time_s) continue;
            other = {progress, label.first, label.first_base, true, false};
        }
    }
}

bool FieldRun::later(const Event& a, const Event& b) {
    if (a.time_s != b.time_s) return a.time_s > b.time_s;
    if (a.kind != b.kind) return a.kind > b.kind;
    if (a.rank != b.rank) return a.rank > b.rank;
    return a.uav > b.uav;
}

void FieldRun::push(double time_s, Kind kind, int uav) {
    events_.push_back({time_s, kind, rank_[uav], uav});
    std::push_heap(events_.begin(), events_.end(), later);
}

void FieldRun::run(const FieldProblem& problem, const FieldTeam& team, FieldRule rule,
                   Watch& watch, int first) {
    bars_.clear();
    decider_.forget();
    n_run_ = 0;
    do {
        once(problem, team, rule, watch, first);
    } while (!watch.stopped() && bar_a_visit());
    if (!watch.stopped()) return;
    for (auto last = decisions_.end(); last != decisions_.begin();) {
        Uav& self = uavs_[(--last)->uav];
        if (self.n_since_task == 0) continue;
        --self.n_since_task;  // a visit to a base that no task follows
        last = decisions_.erase(last);
    }
}

// Whether someone flew to a base in vain; the earliest such visit is barred from now on. Bars of
// later visits are lifted, for what comes after this one changes, unless that has gone on for long.
bool FieldRun::bar_a_visit() {
    bool any = false;
    Bar earliest{};
    for (int uav = 0; uav < static_cast<int>(uavs_.size()); ++uav) {
        const Uav& self = uavs_[uav];
        if (self.n_since_task == 0) continue;
        const Bar bar{self.visit_s, rank_[uav], uav, self.n_item - self.n_since_task};
        if (!any || bar < earliest) earliest = bar;
        any = true;
    }
    if (!any) return false;
    if (++n_run_ <= kMostRuns) {
        bars_.erase(std::remove_if(bars_.begin(), bars_.end(),
                                   [&](const Bar& bar) { return earliest < bar; }),
                    bars_.end());
    }
    bars_.push_back(earliest);
    return true;
}

bool FieldRun::barred(int uav) const {
    return std::any_of(bars_.begin(), bars_.end(), [&](const Bar& bar) {
        return bar.uav == uav && bar.n_item == uavs_[uav].n_item;
    });
}

void FieldRun::begin(const FieldProblem& problem, const FieldTeam& team) {
    rank_ = team.rank;
    open_.clear();
    for (int task = 0; task < problem.n_task; ++task) {
        if (team.open[task]) open_.push_back(task);
    }
    traffic_.reset(problem, team);
    waiting_.resize(problem.n_base);
    for (std::vector<int>& waiting : waiting_) waiting.clear();
    uavs_.clear();
    events_.clear();
    decisions_.clear();
    decided_.assign(problem.n_uav, 0);
    n_in_vain_ = 0;
    for (int uav = 0; uav < problem.n_uav; ++uav) {
        const int base = team.landed_at[uav];
        uavs_.push_back({team.begin(problem, uav), 0, 0, base, base >= 0});
        const int leaving = team.leaving_base(uav);
        if (leaving >= 0 && traffic_.limited(leaving)) {
            push(team.leaves_s[uav], Kind::kRelease, uav);
        }
        if (!team.active[uav] || team.free_s[uav] == kNever) continue;
        if (team.is_bound(uav) && traffic_.limited(base)) {
            uavs_.back().progress = team.above_base(problem, uav);
            push(team.arrives_s[uav], Kind::kArrival, uav);
        } else {
            push(team.free_s[uav], Kind::kDecision, uav);
        }
    }
}

void FieldRun::once(const FieldProblem& problem, const FieldTeam& team, FieldRule rule,
                    Watch& watch, int first) {
    begin(problem, team);
    // A visit that turns out to be in vain is undone, and all that came after it; so what is decided
    // is certain as soon as no visit is open.
    while (!events_.empty() && !(first >= 0 && decided_[first] && n_in_vain_ == 0)) {
        std::pop_heap(events_.begin(), events_.end(), later);
        const Event event = events_.back();
        events_.pop_back();
        if (event.kind == Kind::kRelease) {
            release(problem, event.uav);
        } else if (event.kind == Kind::kDecision) {
            decide(problem, rule, event.uav, watch);
        } else {
            const int base = uavs_[event.uav].base;
            if (traffic_.any_free(base)) {
                touch_down(problem, event.uav, traffic_.lands_s(problem, event.uav));
            } else {
                waiting_[base].push_back(event.uav);
            }
        }
    }
}

void FieldRun::decide(const FieldProblem& problem, FieldRule rule, int uav, Watch& watch) {
    Uav& self = uavs_[uav];
    const double now_s = self.progress.time_s;
    const int here = self.progress.landed ? self.base : -1;
    // As many swaps in a row as there are bases lead everywhere.
    const Swaps swaps = barred(uav) ? Swaps::kNever
                        : self.n_before + self.n_since_task >= problem.n_base ? Swaps::kLater
                                                                              : Swaps::kNow;
    decided_[uav] = 1;
    FieldChoice choice;
    if (!watch.stops_after(steps_of(rule, open_.size()))) {
        choice = decider_.decide(rule, {problem, open_, uav, rank_[uav], self.progress, here},
                                 traffic_, swaps);
    }
    const bool holds = traffic_.holds(uav);
    if (choice.home) {
        if (holds) release(problem, uav);
        return;
    }
    decisions_.push_back({uav, now_s, choice});
    ++self.n_item;
    if (!is_base(choice.item)) {
        const int task = task_of(choice.item);
        do_task(problem, uav, choice.item, self.progress, choice.times);
        n_in_vain_ -= self.n_since_task > 0;
        self.n_since_task = self.n_before = 0;
        open_.erase(std::lower_bound(open_.begin(), open_.end(), task));
        push(self.progress.time_s, Kind::kDecision, uav);
        if (!holds) return;
        if (choice.times.depart_s > now_s) {
            traffic_.stays(uav, choice.times.depart_s);
            push(choice.times.depart_s, Kind::kRelease, uav);
        } else {
            release(problem, uav);
        }
        return;
    }
    if (holds) release(problem, uav);
    if (self.n_since_task == 0) {
        ++n_in_vain_;
        self.visit_s = now_s;
    }
    ++self.n_since_task;
    self.base = base_of(choice.item);
    const double arrive_s = arrival_s(problem, self.base, self.progress);
    if (!traffic_.limited(self.base)) {
        touch_down(problem, uav, arrive_s);
        return;
    }
    const double sortie_end_s = self.progress.landed ? self.progress.time_s + problem.full_s[uav]
                                                     : self.progress.sortie_end_s;
    traffic_.approach(uav, self.base, {arrive_s, rank_[uav], uav}, sortie_end_s);
    push(arrive_s, Kind::kArrival, uav);
}

// A slot is free for it; if that is too late for its energy it has gone home instead.
void FieldRun::touch_down(const FieldProblem& problem, int uav, double begin_s) {
    Uav& self = uavs_[uav];
    Times times;
    const Refusal refusal = swap_battery(problem, uav, self.base, begin_s, self.progress, times);
    if (traffic_.limited(self.base)) {
        if (refusal != Refusal::kNone) {
            traffic_.give_up(uav);
        } else {
            traffic_.hold(uav, self.base, self.progress.time_s);
        }
    }
    if (refusal == Refusal::kNone) push(self.progress.time_s, Kind::kDecision, uav);
}

void FieldRun::release(const FieldProblem& problem, int uav) {
    const int base = traffic_.base_of_holder(uav);
    traffic_.leave(uav);
    std::vector<int>& waiting = waiting_[base];
    while (!waiting.empty() && traffic_.any_free(base)) {
        const int next = waiting.front();
        waiting.erase(waiting.begin());
        touch_down(problem, next, traffic_.lands_s(problem, next));
    }
}

}  // namespace peckorder
