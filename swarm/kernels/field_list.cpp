#include "field_list.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace peckorder {

namespace {
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kMostLabels = 16;
constexpr int kMostBases = 4;  // between two tasks; those of the earliest arrival that help
constexpr double kRounding = 1e-9;  // sums in another order must not refuse more

// Put `label` among those after the same tasks, unless one of them makes it needless. That is not
// exact where a battery is swapped later: who departs from a base earlier may have to wait longer in
// the air, for what opens later. Keeping the later label there made no plan better, and took time.
void keep(std::vector<ListLabel>& labels, const ListLabel& label) {
    const Progress& one = label.progress;
    std::size_t kept = 0;
    for (std::size_t k = 0; k < labels.size(); ++k) {
        const Progress& other = labels[k].progress;
        if (labels[k].item == label.item) {
            if (other.time_s <= one.time_s && other.sortie_end_s >= one.sortie_end_s &&
                other.value >= one.value) {
                return;  // nothing was taken out: what beats `label` beats all that it beats
            }
            if (one.time_s <= other.time_s && one.sortie_end_s >= other.sortie_end_s &&
                one.value >= other.value) {
                continue;
            }
        }
        if (kept != k) labels[kept] = labels[k];
        ++kept;
    }
    labels.resize(kept);
    if (static_cast<int>(kept) >= kMostLabels) {
        auto worst = std::min_element(labels.begin(), labels.end(),
                                      [](const ListLabel& a, const ListLabel& b) {
                                          return a.progress.value < b.progress.value;
                                      });
        if (worst->progress.value < one.value) *worst = label;
        return;
    }
    labels.push_back(label);
}

void prefetch(const double* place) {
#if defined(__GNUC__)
    __builtin_prefetch(place);
#else
    static_cast<void>(place);
#endif
}

}  // namespace

double Stays::begin_s(int base, int uav, double arrive_s) const {
    const std::vector<Held>& held = at_[base];
    const double land_s = problem_->land_s[uav];
    const Arrival own{arrive_s, team_->rank[uav], uav};
    auto end = std::lower_bound(held.begin(), held.end(), own, [](const Held& a, const Arrival& b) {
        return a.arrival < b;
    });
    leaves_s_.clear();
    while (end != held.begin() && (--end)->latest_s + land_s > arrive_s) {
        if (end->leave_s + land_s > arrive_s && end->arrival.uav != uav)
            leaves_s_.push_back(end->leave_s);
    }
    const std::size_t slots = static_cast<std::size_t>(problem_->slots[base]);
    if (leaves_s_.size() < slots) return arrive_s;
    std::sort(leaves_s_.begin(), leaves_s_.end());
    return touch_down_s(*problem_, uav, arrive_s, leaves_s_[leaves_s_.size() - slots]);
}

void Stays::set(int uav, const std::vector<Stay>& stays) {
    std::vector<Stay>& old = of_[uav];
    const auto same = [](const Stay& a, const Stay& b) {
        return a.base == b.base && a.arrive_s == b.arrive_s && a.leave_s == b.leave_s;
    };
    if (std::equal(old.begin(), old.end(), stays.begin(), stays.end(), same)) return;
    const std::int64_t rank = team_->rank[uav];
    for (std::size_t base = 0; base < at_.size(); ++base) {
        std::vector<Held>& held = at_[base];
        const auto gone = std::remove_if(held.begin(), held.end(),
                                         [&](const Held& a) { return a.arrival.uav == uav; });
        bool changed = gone != held.end();
        held.erase(gone, held.end());
        for (const Stay& stay : stays) {
            if (stay.base != static_cast<int>(base)) continue;
            held.push_back({{stay.arrive_s, rank, uav}, stay.leave_s, 0.0});
            changed = true;
        }
        if (changed) arrange(static_cast<int>(base));
    }
    old = stays;
    version_ = ++*last_version_;
}

void Stays::arrange(int base) {
    std::vector<Held>& held = at_[base];
    std::sort(held.begin(), held.end(),
              [](const Held& a, const Held& b) { return a.arrival < b.arrival; });
    double latest_s = -kInfinity;
    for (Held& one : held) one.latest_s = latest_s = std::max(latest_s, one.leave_s);
}

bool ListSolver::hop(int uav, const Stays& stays, const Progress& from, int base,
                     bool& meets_slots, Progress& ready) {
    double begin_s = arrival_s(problem_, base, from);
    if (!std::isfinite(begin_s)) return false;
    if (from.landed && begin_s == from.time_s) return false;  // it stands there
    if (stays.limited(base)) {
        meets_slots = true;
        begin_s = stays.begin_s(base, uav, begin_s);
        if (!std::isfinite(begin_s)) return false;  // who stands there stays for good
    }
    ready = from;
    Times times;
    return swap_battery(problem_, uav, base, begin_s, ready, times) == Refusal::kNone;
}

// The earliest readiness at every base, over other bases where it can't be reached at once.
void ListSolver::reach_bases(int uav, const Stays& stays, const Progress& from,
                             bool& meets_slots) {
    bool all = true, any = false;
    for (int base = 0; base < problem_.n_base; ++base) {
        const bool reached = hop(uav, stays, from, base, meets_slots, ready_[base]);
        before_[base] = reached ? -1 : -2;
        (reached ? any : all) = reached;
    }
    for (bool found = any && !all; found;) {
        found = false;
        for (int base = 0; base < problem_.n_base; ++base) {
            if (before_[base] == -1) continue;
            for (int via = 0; via < problem_.n_base; ++via) {
                Progress ready;
                if (via == base || before_[via] == -2 || before_[via] == base ||
                    !hop(uav, stays, ready_[via], base, meets_slots, ready)) {
                    continue;
                }
                if (before_[base] != -2 && ready.time_s >= ready_[base].time_s) continue;
                ready_[base] = ready;
                before_[base] = via;
                found = true;
            }
        }
    }
}

bool ListSolver::try_task(int uav, const Progress& from, int parent, int base, int task,
                          std::vector<ListLabel>& into) {
    bool can = false;
    for (int backwards = 0; backwards <= problem_.is_line[task]; ++backwards) {
        ListLabel label{from, parent, item_of_task(task, backwards), base};
        Times times;
        ++steps;
        if (do_task(problem_, uav, label.item, label.progress, times) == Refusal::kNone) {
            keep(into, label);
            can = true;
        }
    }
    return can;
}

void ListSolver::extend(int uav, const Stays& stays, const ListLabel* from, int count, int task,
                        std::vector<ListLabel>& into, bool& meets_slots) {
    into.clear();
    const bool may_swap = swaps(uav);
    for (int k = 0; k < count; ++k) {
        const Progress& progress = from[k].progress;
        try_task(uav, progress, k, -1, task, into);
        if (!may_swap) continue;
        if (overlooks_ > 0.0 && random_->uniform() < overlooks_) continue;
        reach_bases(uav, stays, progress, meets_slots);
        steps += problem_.n_base;
        if (problem_.n_base <= kMostBases) {
            for (int base = 0; base < problem_.n_base; ++base) {
                if (before_[base] != -2) try_task(uav, ready_[base], k, base, task, into);
            }
            continue;
        }
        const int enter = problem_.enter_node(item_of_task(task, 0));
        double last_s = -kInfinity;
        int last = -1;
        for (int helpful = 0; helpful < kMostBases;) {
            int next = -1;
            double next_s = kInfinity;
            for (int base = 0; base < problem_.n_base; ++base) {
                if (before_[base] == -2) continue;
                const double arrive_s = ready_[base].time_s + ready_[base].legs_s[enter];
                const bool later = arrive_s > last_s || (arrive_s == last_s && base > last);
                if (later && arrive_s < next_s) {
                    next = base;
                    next_s = arrive_s;
                }
            }
            if (next < 0) break;
            helpful += try_task(uav, ready_[next], k, next, task, into);
            last = next;
            last_s = next_s;
        }
    }
}

bool ListSolver::can_do(const FieldList& list, const Stays& stays, int task) {
    bool ignored = false;
    extend(list.uav, stays, list.labels.data(), 1, task, here_, ignored);
    return !here_.empty();
}

// A place is valued in three steps, each ending it if the bound is not above the best gain so far:
// by earliest times alone, with the labels after the new task, and with those after each task that
// follows.
ItemInsertion ListSolver::best_place(FieldList& list, const Stays& stays, int task,
                                 bool& meets_slots) {
    bounds_.clear();
    bound_places(list, task, bounds_);
    std::make_heap(bounds_.begin(), bounds_.end());
    ItemInsertion best;
    while (!bounds_.empty() && bounds_.front().gain > best.gain) {
        std::pop_heap(bounds_.begin(), bounds_.end());
        ItemInsertion next = bounds_.back();
        bounds_.pop_back();
        next.gain = gain_at(list, stays, next.place, task, best.gain, meets_slots);
        if (next.gain > best.gain) best = next;
    }
    return best;
}

void ListSolver::bound_places(FieldList& list, int task, std::vector<ItemInsertion>& bounds) {
    if (list.value == -kInfinity) return;
    learn(list);
    for (std::size_t place = 0; place <= list.order.size(); ++place)
        bounds.push_back({most_with(list, place, task) - list.value, place, list.uav});
    steps += static_cast<std::int64_t>(list.order.size()) + 1;
}

double ListSolver::gain_at(const FieldList& list, const Stays& stays, std::size_t place, int task,
                           double least, bool& meets_slots) {
    const double above = list.value + least;
    return value_with(list, stays, place, task, above, meets_slots) - list.value;
}

void ListSolver::fetch(const FieldList& list, int task) const {
    const int enter = problem_.enter_node(item_of_task(task, 0));
    const double* legs_s = problem_.legs_from(list.uav, enter);
    for (const Item item : list.order) {
        const int node = problem_.enter_node(item);
        prefetch(legs_s + node);
        prefetch(problem_.legs_from(list.uav, problem_.leave_node(item)) + enter);
    }
}

// The value with `task` at that place if it is above `least`; else -infinity.
double ListSolver::value_with(const FieldList& list, const Stays& stays, std::size_t place,
                              int task, double least, bool& meets_slots) {
    const int first = list.offsets[place], last = list.offsets[place + 1];
    const double survival = problem_.survival[problem_.at(list.uav, task)];
    const bool charged = list.is_charged;
    from_.assign(list.labels.begin() + first, list.labels.begin() + last);
    if (charged) {
        most_charged_with(list, place, task);
        std::size_t hopeful = 0;
        for (std::size_t k = 0; k < from_.size(); ++k)
            if (bound_[k] > least) from_[hopeful++] = from_[k];
        from_.resize(hopeful);
    }
    extend(list.uav, stays, from_.data(), static_cast<int>(from_.size()), task, here_, meets_slots);
    if (charged && list.is_charged_exact) {
        double most = -kInfinity;
        for (const ListLabel& label : here_) {
            const double rest = most_from(list, place, label.progress);
            most = std::max(most, label.progress.value + survival * rest);
        }
        return most > least ? most : -kInfinity;
    }
    for (std::size_t k = place; k < list.order.size(); ++k) {
        const int next = task_of(list.order[k]);
        const double step_s = k == place ? least_leg_s(list.uav, task, next) : list.on[k].step_s;
        int hopeful = 0;
        for (const ListLabel& label : here_) {
            const Progress& now = label.progress;
            if (!(now.value + most_value(list, k, now.time_s + step_s, survival) > least)) continue;
            if (charged) {
                const double most =
                    k == place ? most_from(list, k, now)
                               : most_after(list, k - 1, label.item, charge_s(list.uav, now)) -
                                     list.on[k].slope * now.time_s;
                const double value = now.value + survival * most;
                if (!(value + kRounding * (std::abs(value) + 1.0) > least)) continue;
            }
            here_[hopeful++] = label;
        }
        if (hopeful == 0) return -kInfinity;
        extend(list.uav, stays, here_.data(), hopeful, next, next_, meets_slots);
        std::swap(here_, next_);
    }
    double best = -kInfinity;
    for (const ListLabel& label : here_) best = std::max(best, label.progress.value);
    return best > least ? best : -kInfinity;
}

bool ListSolver::solve(FieldList& list, const Stays& stays, std::size_t kept, Random* random,
                       double overlooks) {
    random_ = random;
    overlooks_ = overlooks;
    list.version = ++last_version_;
    list.items.clear();
    const bool stale = list.meets_slots && list.stays_version != stays.version();
    if (kept == 0 || stale || list.offsets.size() < 2) {
        kept = 0;
        list.meets_slots = false;
        list.labels.assign(1, ListLabel{team_.begin(problem_, list.uav), 0, 0, -1});
        list.offsets.assign({0, 1});
    }
    // A list that could not be done has labels of its beginning alone.
    kept = std::min(kept, list.offsets.size() - 2);
    while (kept > 0 && list.offsets[kept] == list.offsets[kept + 1]) --kept;
    list.offsets.resize(kept + 2);
    list.labels.resize(list.offsets.back());
    for (std::size_t k = kept; k < list.order.size(); ++k) {
        const int first = list.offsets[k];
        extend(list.uav, stays, list.labels.data() + first, list.offsets[k + 1] - first,
               task_of(list.order[k]), here_, list.meets_slots);
        list.labels.insert(list.labels.end(), here_.begin(), here_.end());
        list.offsets.push_back(static_cast<int>(list.labels.size()));
        if (here_.empty()) break;
    }
    overlooks_ = 0.0;
    list.stays_version = stays.version();
    list.value = 0.0;
    if (list.order.empty()) return true;
    const bool all = list.offsets.size() == list.order.size() + 2;
    if (!all || list.offsets.back() == list.offsets.end()[-2]) return false;
    int best = list.offsets.end()[-2];
    for (int k = best; k < list.offsets.back(); ++k) {
        if (list.labels[k].progress.value > list.labels[best].progress.value) best = k;
    }
    list.value = list.labels[best].progress.value;
    write_items(list, stays, best - list.offsets.end()[-2]);
    return true;
}

void ListSolver::refresh(FieldList& list, const Stays& stays) {
    if (!list.meets_slots || list.stays_version == stays.version()) return;
    before_refresh_ = list;
    const bool can = solve(list, stays, 0);
    list.items.swap(before_refresh_.items);
    list.order.swap(before_refresh_.order);
    if (can) return;
    // Labels are beliefs: those of before stay, for whoever works on the list expects some.
    list.labels.swap(before_refresh_.labels);
    list.offsets.swap(before_refresh_.offsets);
    list.value = -kInfinity;
    list.meets_slots = true;
}

// From the last label back; which bases lie between two tasks is worked out again.
void ListSolver::write_items(FieldList& list, const Stays& stays, int last) {
    bool ignored = false;
    for (std::size_t k = list.order.size(); k-- > 0;) {
        const ListLabel& label = list.labels[list.offsets[k + 1] + last];
        list.order[k] = label.item;
        list.items.push_back(label.item);
        last = label.parent;
        if (label.base < 0) continue;
        reach_bases(list.uav, stays, list.labels[list.offsets[k] + last].progress, ignored);
        for (int base = label.base; base >= 0; base = before_[base])
            list.items.push_back(item_of_base(base));
    }
    std::reverse(list.items.begin(), list.items.end());
}

}  // namespace peckorder
