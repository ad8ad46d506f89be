#include "field_list.hpp"

#include <algorithm>
#include <utility>

namespace peckorder {

namespace {
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kMostLabels = 16;
constexpr int kMostBases = 4;  // so many are tried between two tasks, those of the earliest arrival

// Put `label` among those after the same tasks, unless one of them makes it needless.
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
}  // namespace

double Stays::begin_s(int base, int uav, double arrive_s) const {
    leaves_s_.clear();
    for (int other = 0; other < problem_->n_uav; ++other) {
        if (other == uav) continue;
        for (const Stay& stay : of_[other]) {
            if (stay.base != base || stay.leave_s <= arrive_s || stay.arrive_s > arrive_s) continue;
            if (stay.arrive_s == arrive_s &&
                std::make_pair(team_->rank[other], other) > std::make_pair(team_->rank[uav], uav)) {
                continue;
            }
            leaves_s_.push_back(stay.leave_s);
        }
    }
    const std::size_t slots = static_cast<std::size_t>(problem_->slots[base]);
    if (leaves_s_.size() < slots) return arrive_s;
    std::sort(leaves_s_.begin(), leaves_s_.end());
    return leaves_s_[leaves_s_.size() - slots];
}

void Stays::set(int uav, const std::vector<Stay>& stays) {
    const std::vector<Stay>& old = of_[uav];
    const auto same = [](const Stay& a, const Stay& b) {
        return a.base == b.base && a.arrive_s == b.arrive_s && a.leave_s == b.leave_s;
    };
    if (std::equal(old.begin(), old.end(), stays.begin(), stays.end(), same)) return;
    of_[uav] = stays;
    version_ = ++*last_version_;
}

bool ListSolver::hop(int uav, const Stays& stays, const Progress& from, int base,
                     bool& meets_slots, Progress& ready) {
    double begin_s = arrival_s(problem_, base, from);
    if (!std::isfinite(begin_s)) return false;
    if (from.landed && begin_s == from.time_s) return false;  // it stands there
    if (stays.limited(base)) {
        meets_slots = true;
        begin_s = stays.begin_s(base, uav, begin_s);
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

void ListSolver::try_task(int uav, const Progress& from, int parent, int base, int task,
                          std::vector<ListLabel>& into) {
    for (int backwards = 0; backwards <= problem_.is_line[task]; ++backwards) {
        ListLabel label{from, parent, item_of_task(task, backwards), base};
        Times times;
        ++steps;
        if (do_task(problem_, uav, label.item, label.progress, times) == Refusal::kNone) {
            keep(into, label);
        }
    }
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
        for (int tried = 0; tried < kMostBases; ++tried) {
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
            try_task(uav, ready_[next], k, next, task, into);
            last = next;
            last_s = next_s;
        }
    }
}

double ListSolver::value_with(const FieldList& list, const Stays& stays, std::size_t place,
                              int task, bool& meets_slots) {
    const int first = list.offsets[place];
    extend(list.uav, stays, list.labels.data() + first, list.offsets[place + 1] - first, task,
           here_, meets_slots);
    for (std::size_t k = place; k < list.order.size() && !here_.empty(); ++k) {
        extend(list.uav, stays, here_.data(), static_cast<int>(here_.size()),
               task_of(list.order[k]), next_, meets_slots);
        std::swap(here_, next_);
    }
    double best = -kInfinity;
    for (const ListLabel& label : here_) best = std::max(best, label.progress.value);
    return best;
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
    std::vector<Item> items = list.items, order = list.order;
    if (!solve(list, stays, 0)) list.value = -kInfinity;
    list.items = std::move(items);
    list.order = std::move(order);
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

bool TeamFlight::takes_part(const FieldTeam& team, const Stays& stays, const FieldList& list) {
    if (list.items.empty()) return false;
    const int begins = team.landed_at[list.uav];
    if (begins >= 0 && stays.limited(begins)) return true;
    return std::any_of(list.items.begin(), list.items.end(), [&](Item item) {
        return is_base(item) && stays.limited(base_of(item));
    });
}

// Up to the next base where it may have to wait, or to the end; `depart_s`: of its first item, if
// it has done one.
bool TeamFlight::fly_on(const FieldList& list, const Stays& stays, Pilot& pilot,
                        double& depart_s) {
    pilot.waits = false;
    for (bool first = true; pilot.next < list.items.size(); ++pilot.next, first = false) {
        const Item item = list.items[pilot.next];
        if (is_base(item) && stays.limited(base_of(item))) {
            pilot.arrive_s = arrival_s(problem_, base_of(item), pilot.progress);
            if (first) depart_s = pilot.progress.time_s;
            pilot.waits = true;
            return true;
        }
        Times times;
        if (do_item(problem_, list.uav, item, pilot.progress, times) != Refusal::kNone)
            return false;
        if (first) depart_s = times.depart_s;
    }
    return true;
}

int TeamFlight::fly(const std::vector<FieldList>& lists, Stays& stays, std::vector<double>& value,
                    std::size_t& failed_at) {
    for (int base = 0; base < problem_.n_base; ++base)
        if (stays.limited(base)) free_s_[base].assign(problem_.slots[base], -kInfinity);
    std::size_t count = 0;
    for (const FieldList& list : lists) {
        if (!takes_part(team_, stays, list)) continue;
        Pilot& pilot = pilots_[count++];
        pilot.uav = list.uav;
        pilot.progress = team_.begin(problem_, list.uav);
        pilot.next = 0;
        pilot.stays.clear();
        double depart_s = 0.0;
        const bool flew = fly_on(list, stays, pilot, depart_s);
        failed_at = pilot.next;
        if (!flew) return list.uav;
        const int begins = team_.landed_at[list.uav];
        if (begins < 0 || !stays.limited(begins)) continue;
        *std::min_element(free_s_[begins].begin(), free_s_[begins].end()) = depart_s;
        pilot.stays.push_back({begins, -kInfinity, depart_s});
    }
    while (true) {
        Pilot* first = nullptr;
        for (std::size_t k = 0; k < count; ++k) {
            Pilot& pilot = pilots_[k];
            if (!pilot.waits) continue;
            if (first == nullptr || pilot.arrive_s < first->arrive_s ||
                (pilot.arrive_s == first->arrive_s &&
                 team_.rank[pilot.uav] < team_.rank[first->uav])) {
                first = &pilot;
            }
        }
        if (first == nullptr) break;
        const FieldList& list = lists[first->uav];
        const int base = base_of(list.items[first->next]);
        auto slot = std::min_element(free_s_[base].begin(), free_s_[base].end());
        const double begin_s = std::max(first->arrive_s, *slot);
        const double arrive_s = first->arrive_s;
        Times times;
        failed_at = first->next;
        if (swap_battery(problem_, first->uav, base, begin_s, first->progress, times) !=
            Refusal::kNone)
            return first->uav;
        ++first->next;
        double leave_s = times.end_s;
        const bool flew = fly_on(list, stays, *first, leave_s);
        failed_at = first->next;
        if (!flew) return first->uav;
        *slot = leave_s;
        first->stays.push_back({base, arrive_s, leave_s});
    }
    for (std::size_t k = 0; k < count; ++k) {
        value[pilots_[k].uav] = pilots_[k].progress.value;
        stays.set(pilots_[k].uav, pilots_[k].stays);
    }
    failed_at = 0;
    return -1;
}

}  // namespace peckorder
