#include "field_search.hpp"

#include <algorithm>
#include <numeric>

#include "parallel.hpp"

namespace peckorder {

namespace {
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kMostNear = 64;
constexpr int kLanes = 2;
constexpr double kListBlink = 0.02;
constexpr int kMostOut = 12;  // tasks on no list that are tried besides those torn out
constexpr double kHottest = 1.0;  // of the scale; at the end a 333rd of that
constexpr int kAlwaysPrecise = 16;  // up to so many tasks, and else in a share of iterations,
constexpr double kPreciseShare = 0.3;  // what lists could take is asked anew as stays change
constexpr double kPrize = 100.0;  // of the scale, in the annealing; the best is compared exactly
}  // namespace

FieldLane::FieldLane(const FieldProblem& problem, const FieldTeam& team, std::uint64_t seed)
    : problem_(problem),
      team_(team),
      random_(seed),
      solver_(problem, team, last_version_),
      flown_(problem.n_uav),
      stays_(problem, team, last_version_),
      lists_(problem.n_uav),
      value_(problem.n_uav, 0.0),
      near_(problem.n_task),
      able_(problem.n_task),
      weight_(problem.n_task, 0.0),
      list_of_(problem.n_task, -1),
      place_out_(problem.n_task, -1),
      known_(static_cast<std::size_t>(problem.n_uav) * problem.n_task),
      is_touched_(problem.n_uav, 0),
      copies_(problem.n_uav),
      stays_before_(stays_),
      best_(problem.n_uav) {
    for (int base = 0; base < problem.n_base; ++base) any_limited_ |= stays_.limited(base);
    for (int uav = 0; uav < problem.n_uav; ++uav) {
        lists_[uav].uav = uav;
        believe_stays(uav, nullptr, 0);
        solver_.solve(lists_[uav], stays_, 0);
        if (team.active[uav] && std::isfinite(team.free_s[uav])) uavs_.push_back(uav);
        any_swaps_ |= problem.n_base > 0 && std::isfinite(problem.full_s[uav]);
    }
    find_doable();
    find_near();
    for (const int task : tasks_) {
        place_out_[task] = static_cast<int>(out_.size());
        out_.push_back(task);
    }
    std::sort(tasks_.begin(), tasks_.end(), [&](int a, int b) {
        const bool wanted_a = problem_.required[a], wanted_b = problem_.required[b];
        if (wanted_a != wanted_b) return wanted_a;
        return weight_[a] != weight_[b] ? weight_[a] > weight_[b] : a < b;
    });
    best_worth_ = worth();
}

void FieldLane::find_doable() {
    for (int task = 0; task < problem_.n_task; ++task) {
        if (!team_.open[task]) continue;
        for (const int uav : uavs_) {
            if (!problem_.capable[problem_.at(uav, task)]) continue;
            if (!solver_.can_do(lists_[uav], stays_, task)) continue;
            able_[task].push_back(uav);
            weight_[task] = std::max(weight_[task], problem_.weight[problem_.at(uav, task)]);
        }
        if (!able_[task].empty()) tasks_.push_back(task);
    }
}

void FieldLane::find_near() {
    std::vector<std::pair<double, int>> order;
    double sum = 0.0;
    for (const int task : tasks_) {
        const int uav = able_[task].front();
        const Item forwards = item_of_task(task, 0);
        const double* from_s = problem_.legs_from(uav, problem_.leave_node(forwards));
        const double* back_s = problem_.legs_from(uav, problem_.enter_node(forwards));
        order.clear();
        for (const int other : tasks_) {
            if (other == task) continue;
            const Item item = item_of_task(other, 0);
            const int enter = problem_.enter_node(item), leave = problem_.leave_node(item);
            const double leg_s = std::min(std::min(from_s[enter], from_s[leave]),
                                          std::min(back_s[enter], back_s[leave]));
            order.emplace_back(leg_s, other);
        }
        const std::size_t kept = std::min<std::size_t>(kMostNear, order.size());
        std::partial_sort(order.begin(), order.begin() + kept, order.end());
        for (std::size_t k = 0; k < kept; ++k) near_[task].push_back(order[k].second);
        double leg_s = kept == 0 ? 0.0 : order[std::min<std::size_t>(2, kept - 1)].first;
        if (!std::isfinite(leg_s)) leg_s = 0.0;
        const double line_s = problem_.line_time_s(uav, forwards);
        const double work_s = problem_.service_s[task] + (std::isfinite(line_s) ? line_s : 0.0);
        sum += weight_[task] * (leg_s + work_s);
    }
    scale_ = tasks_.empty() ? 0.0 : sum / static_cast<double>(tasks_.size());
    prize_ = kPrize * scale_;
}

void FieldLane::load(const ItemLists& lists) {
    for (const int task : tasks_) move(task, -1, false);
    for (const int uav : uavs_) {
        FieldList& list = lists_[uav];
        list.order.clear();
        for (const Item item : lists[uav]) {
            if (is_base(item)) continue;
            const int task = task_of(item);
            const std::vector<int>& able = able_[task];
            if (!std::binary_search(able.begin(), able.end(), uav) || list_of_[task] >= 0) continue;
            list.order.push_back(item);
            move(task, uav, false);
        }
        settle(uav, 0);
    }
    // The very lists that were given, if they can be flown as they are.
    std::vector<std::vector<Item>> solved(problem_.n_uav);
    for (const int uav : uavs_) {
        solved[uav] = lists_[uav].items;
        std::size_t n_task = 0;
        for (const Item item : lists[uav]) n_task += !is_base(item);
        if (n_task > 0 && n_task == lists_[uav].order.size()) lists_[uav].items = lists[uav];
    }
    if (!fly()) {
        for (const int uav : uavs_) lists_[uav].items = solved[uav];
        fly_together();
    }
    note_best(worth());
    touched_.clear();
    std::fill(is_touched_.begin(), is_touched_.end(), 0);
    moved_.clear();
    placed_ = 0;
}

Worth FieldLane::worth() const {
    Worth now;
    for (const int task : out_) now.left_out += problem_.required[task];
    for (const int uav : uavs_) now.value += value_[uav];
    return now;
}

void FieldLane::note_best(const Worth& now) {
    if (!(now > best_worth_)) return;
    best_worth_ = now;
    for (const int uav : uavs_) best_[uav] = lists_[uav].items;
}

void FieldLane::touch(int uav) {
    if (is_touched_[uav]) return;
    is_touched_[uav] = 1;
    copies_[touched_.size()] = lists_[uav];
    touched_.push_back(uav);
}

void FieldLane::move(int task, int uav, bool noted) {
    const int before = list_of_[task];
    if (before == uav) return;
    if (noted) moved_.emplace_back(task, before);
    list_of_[task] = uav;
    if (uav < 0) {
        place_out_[task] = static_cast<int>(out_.size());
        out_.push_back(task);
    } else if (before < 0) {
        const int last = out_.back();
        out_[place_out_[task]] = last;
        place_out_[last] = place_out_[task];
        place_out_[task] = -1;
        out_.pop_back();
    }
}

void FieldLane::undo() {
    for (std::size_t k = moved_.size(); k-- > 0;) move(moved_[k].first, moved_[k].second, false);
    for (std::size_t k = 0; k < touched_.size(); ++k)
        std::swap(lists_[touched_[k]], copies_[k]);
    value_ = value_before_;
    if (any_limited_) stays_ = stays_before_;
}

// Solve a list whose tasks changed from number `kept` on; what can't be done any more is taken out.
void FieldLane::settle(int uav, std::size_t kept, double overlooks) {
    FieldList& list = lists_[uav];
    while (!solver_.solve(list, stays_, kept, &random_, overlooks)) {
        const std::size_t failed = list.offsets.size() - 3;
        const int task = task_of(list.order[failed]);
        list.order.erase(list.order.begin() + static_cast<std::ptrdiff_t>(failed));
        move(task, -1);
        torn_.push_back(task);
        kept = std::min(kept, failed);
        overlooks = 0.0;
    }
    value_[uav] = list.value;
    believe_stays(uav);
}

// The stays of a list as its labels believe.
void FieldLane::believe_stays(int uav) {
    if (!any_limited_) return;
    Progress progress = team_.begin(problem_, uav);
    times_.clear();
    for (const Item item : lists_[uav].items) {
        Times times;
        Refusal refusal;
        if (is_base(item)) {
            const int base = base_of(item);
            double begin_s = arrival_s(problem_, base, progress);
            if (stays_.limited(base)) begin_s = stays_.begin_s(base, uav, begin_s);
            refusal = swap_battery(problem_, uav, base, begin_s, progress, times);
        } else {
            refusal = do_task(problem_, uav, item, progress, times);
        }
        if (refusal != Refusal::kNone) break;
        times_.push_back(times);
    }
    believe_stays(uav, times_.data(), times_.size());
}

// The same by the times of its first `count` items.
void FieldLane::believe_stays(int uav, const Times* times, std::size_t count) {
    if (!any_limited_) return;
    own_stays_.clear();
    const int leaving = team_.leaving_base(uav);
    if (leaving >= 0 && stays_.limited(leaving))
        own_stays_.push_back({leaving, -kInfinity, team_.leaves_s[uav]});
    const bool bound = team_.active[uav] && team_.is_bound(uav);
    int base = bound || team_.stands_on_slot(uav) ? team_.landed_at[uav] : -1;
    double arrive_s = bound ? team_.arrives_s[uav] : -kInfinity;
    double end_s = idle_until_s(team_, uav);
    for (std::size_t k = 0; k < count; ++k) {
        if (base >= 0 && stays_.limited(base))
            own_stays_.push_back({base, arrive_s, times[k].depart_s});
        const Item item = lists_[uav].items[k];
        base = is_base(item) ? base_of(item) : -1;
        arrive_s = times[k].arrive_s;
        end_s = times[k].end_s;
    }
    if (base >= 0 && stays_.limited(base)) own_stays_.push_back({base, arrive_s, end_s});
    stays_.set(uav, own_stays_);
}

// Fly all lists together: what they are worth, and who is at which base when. False: some list
// can't be done.
bool FieldLane::fly() {
    for (const int uav : uavs_) {
        const std::vector<Item>& items = lists_[uav].items;
        flown_[uav] = {items.data(), static_cast<int>(items.size())};
    }
    if (!flights_.fly(problem_, team_, flown_.data(), true)) return false;
    for (const int uav : uavs_) {
        value_[uav] = flights_.flight(uav).value();
        const int count = flown_[uav].count;
        believe_stays(uav, count == 0 ? nullptr : &flights_.times(uav, 0),
                      static_cast<std::size_t>(count));
    }
    return true;
}

void FieldLane::fly_together() {
    if (!any_limited_) return;  // then lists are worth what their labels say
    while (!fly()) {
        const int uav = *std::find_if(uavs_.begin(), uavs_.end(), [&](int each) {
            return flights_.flight(each).refusal != Refusal::kNone;
        });
        touch(uav);
        FieldList& list = lists_[uav];
        std::size_t number = 0;
        for (int k = 0; k < flights_.flight(uav).done; ++k) number += !is_base(list.items[k]);
        number = std::min(number, list.order.size() - 1);
        const int task = task_of(list.order[number]);
        list.order.erase(list.order.begin() + static_cast<std::ptrdiff_t>(number));
        move(task, -1);
        settle(uav, number);
    }
}

void FieldLane::remove(int uav, std::size_t from, std::size_t count) {
    FieldList& list = lists_[uav];
    const auto first = list.order.begin() + static_cast<std::ptrdiff_t>(from);
    for (std::size_t k = 0; k < count; ++k) {
        const int task = task_of(first[static_cast<std::ptrdiff_t>(k)]);
        torn_.push_back(task);
        move(task, -1);
    }
    list.order.erase(first, first + static_cast<std::ptrdiff_t>(count));
    settle(uav, from);
}

FieldLane::Known& FieldLane::known(int uav, int task) { return known_[problem_.at(uav, task)]; }

// What is known of a task on a list: as good as nothing if the list has changed since.
FieldLane::Known& FieldLane::known_now(int uav, int task) {
    FieldList& list = lists_[uav];
    if (precise_) solver_.refresh(list, stays_);
    Known& here = known_[problem_.at(uav, task)];
    const bool same = !precise_ || !here.meets_slots || here.stays == stays_.version();
    if (here.list != list.version || !same) {
        here = Known{};
        here.list = list.version;
        here.stays = stays_.version();
        here.meets_slots = list.meets_slots;
    }
    return here;
}

// Where a list would take a task best.
ItemInsertion FieldLane::best_place(int uav, int task) {
    Known& here = known_now(uav, task);
    if (!here.exact) {
        const ItemInsertion best = solver_.best_place(lists_[uav], stays_, task, here.meets_slots);
        here.most = best.gain;
        here.place = best.place;
        here.exact = true;
    }
    return {here.most, here.place, uav};
}

// Where the lists asked would take a task best, if that gains more than `least`: the place with the
// highest bound of all is valued first.
ItemInsertion FieldLane::best_place(int task, double least) {
    ItemInsertion best{least};
    const auto offer = [&](const ItemInsertion& one) {
        if (one.gain > least && best < one) best = one;
    };
    std::size_t doubtful = 0;
    for (const int uav : asked_) {
        const Known& here = known_now(uav, task);
        if (here.exact) {
            offer({here.most, here.place, uav});
        } else {
            asked_[doubtful++] = uav;
        }
    }
    asked_.resize(doubtful);
    for (const int uav : asked_) {
        if (known(uav, task).most > best.gain) solver_.fetch(lists_[uav], task);
    }
    bounds_.clear();
    for (const int uav : asked_) {
        Known& here = known(uav, task);
        if (!(here.most > best.gain)) continue;
        const std::size_t first = bounds_.size();
        solver_.bound_places(lists_[uav], task, bounds_);
        here.most = -kInfinity;
        for (std::size_t k = first; k < bounds_.size(); ++k)
            here.most = std::max(here.most, bounds_[k].gain);
        if (here.most > best.gain) continue;
        bounds_.resize(first);
    }
    std::make_heap(bounds_.begin(), bounds_.end());
    while (!bounds_.empty() && bounds_.front().gain > best.gain) {
        std::pop_heap(bounds_.begin(), bounds_.end());
        ItemInsertion next = bounds_.back();
        bounds_.pop_back();
        Known& here = known(next.uav, task);
        next.gain = solver_.gain_at(lists_[next.uav], stays_, next.place, task, best.gain,
                                    here.meets_slots);
        offer(next);
    }
    // Of no place was it found, or does its bound allow, that it gains more than the best.
    for (const int uav : asked_) {
        Known& here = known(uav, task);
        here.most = std::min(here.most, best.gain);
    }
    return best;
}

void FieldLane::insert(int uav, std::size_t place, int task) {
    touch(uav);
    FieldList& list = lists_[uav];
    const auto at = list.order.begin() + static_cast<std::ptrdiff_t>(place);
    list.order.insert(at, item_of_task(task, 0));
    move(task, uav);
    const std::size_t before = torn_.size();
    settle(uav, place);
    torn_.resize(before);  // what had to give way stays out for now
}

bool FieldLane::put_back(int task) {
    asked_.clear();
    for (const int uav : able_[task])
        if (random_.uniform() >= kListBlink) asked_.push_back(uav);
    const ItemInsertion best = best_place(task, problem_.required[task] ? -kInfinity : 0.0);
    if (best.uav < 0) return false;
    insert(best.uav, best.place, task);
    return true;
}

// In which order tasks are put back: order_.
void FieldLane::arrange() {
    const int kind = random_.below(8);
    const bool required_first = random_.uniform() < 0.7;
    order_.clear();
    for (const int task : torn_) {
        double key = random_.uniform();
        if (kind >= 2 && kind < 5) key = -weight_[task] * (0.5 + 0.5 * key);
        if (kind == 5 || kind == 6) {
            const double latest_s = std::min(problem_.closes_s[task], problem_.due_s[task]);
            key = std::isfinite(latest_s) ? latest_s : 1e8 + key;
        }
        if (kind == 7) key = static_cast<double>(able_[task].size()) + key;
        if (required_first && !problem_.required[task]) key += 1e9;
        order_.emplace_back(key, task);
    }
    std::sort(order_.begin(), order_.end());
}

void FieldLane::recreate() {
    // Those that were out before: some of them.
    const int others = std::min<int>(kMostOut, static_cast<int>(out_.size()));
    for (int k = 0; k < others; ++k)
        torn_.push_back(others == static_cast<int>(out_.size())
                            ? out_[k]
                            : out_[random_.below(static_cast<int>(out_.size()))]);
    std::sort(torn_.begin(), torn_.end());
    torn_.erase(std::unique(torn_.begin(), torn_.end()), torn_.end());
    arrange();
    if (random_.uniform() < 0.1) {
        put_back_by_regret();
        return;
    }
    for (const auto& [key, task] : order_)
        if (list_of_[task] < 0) put_back(task);
}

// Next the task that loses most if it can't have its best list.
void FieldLane::put_back_by_regret() {
    while (!order_.empty()) {
        double most = -kInfinity;
        std::size_t next = order_.size();
        for (std::size_t k = 0; k < order_.size(); ++k) {
            const int task = order_[k].second;
            double first = problem_.required[task] ? -prize_ : 0.0, second = first;
            bool any = false;
            for (const int uav : able_[task]) {
                const double gain = best_place(uav, task).gain;
                any = any || gain > -kInfinity;
                if (gain > first) {
                    second = first;
                    first = gain;
                } else if (gain > second) {
                    second = gain;
                }
            }
            if (any && first - second > most) {
                most = first - second;
                next = k;
            }
        }
        if (next == order_.size()) return;
        const int task = order_[next].second;
        order_.erase(order_.begin() + static_cast<std::ptrdiff_t>(next));
        if (list_of_[task] < 0) put_back(task);
    }
}

void FieldLane::iterate(double temperature) {
    if (tasks_.empty() || uavs_.empty()) return;
    torn_.clear();
    moved_.clear();
    for (const int uav : touched_) is_touched_[uav] = 0;
    touched_.clear();
    value_before_ = value_;
    if (any_limited_) stays_before_ = stays_;
    precise_ = any_limited_ && (static_cast<int>(tasks_.size()) <= kAlwaysPrecise ||
                                random_.uniform() < kPreciseShare);
    const Worth before = worth();
    while (placed_ < tasks_.size() && list_of_[tasks_[placed_]] >= 0) ++placed_;
    if (placed_ < tasks_.size()) {
        put_back(tasks_[placed_++]);
    } else {
        ruin();
        recreate();
    }
    fly_together();
    const Worth now = worth();
    const double gain =
        (now.value - before.value) - prize_ * static_cast<double>(now.left_out - before.left_out);
    const bool accepted =
        gain > -temperature * random_.exponential() || (now > best_worth_);
    if (accepted) {
        note_best(now);
    } else {
        undo();
    }
}

FieldSearch::FieldSearch(const FieldProblem& problem, const FieldTeam& team,
                         const ItemLists& lists, std::uint64_t seed)
    : work_(kLanes, 0) {
    Random random(seed);
    for (int lane = 0; lane < kLanes; ++lane) {
        lanes_.push_back(std::make_unique<FieldLane>(problem, team, random.bits()));
        lanes_.back()->load(lists);
    }
    best_ = lanes_.front()->best();
    best_worth_ = lanes_.front()->best_worth();
}

void FieldSearch::round(long iterations, double heat, int threads, Watch& watch) {
    const double cold = 1.0 - std::min(1.0, std::max(0.0, heat));
    double temperature = kHottest * lanes_.front()->scale();
    for (int k = 0; k < 64; ++k)
        if (k < cold * 64.0) temperature *= 0.9132;  // its 64th power is 0.003
    parallel_for(lanes_.size(), threads, 1, [&] {
        return [&](std::size_t number) {
            FieldLane& lane = *lanes_[number];
            for (long k = 0; k < iterations; ++k) {
                const std::int64_t before = lane.steps();
                lane.iterate(temperature);
                const std::int64_t work = 2 * (lane.steps() - before) + 50;
                work_[number] += work;
                if (watch.stops_after(work)) return;
            }
        };
    });
    for (const auto& lane : lanes_) {
        if (!(lane->best_worth() > best_worth_)) continue;
        best_worth_ = lane->best_worth();
        best_ = lane->best();
    }
}

std::int64_t FieldSearch::work() const {
    return std::accumulate(work_.begin(), work_.end(), std::int64_t{0});
}

void FieldSearch::gather() {
    for (const auto& lane : lanes_)
        if (best_worth_ > lane->best_worth()) lane->load(best_);
}

}  // namespace peckorder
