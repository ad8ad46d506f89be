// Schedules of a team's lists; see field_team.hpp.
#include "field_team.hpp"

namespace peckorder {

namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

bool later(const Arrival& a, const Arrival& b) { return b < a; }

}  // namespace

void SlotTable::reset(const FieldProblem& problem) {
    first_.assign(1, 0);
    for (int base = 0; base < problem.n_base; ++base) {
        const int slots = problem.slots[base];
        const bool ever_full = slots > 0 && slots < problem.n_uav;
        first_.push_back(first_.back() + (ever_full ? slots : 0));
    }
    free_s_.assign(first_.back(), -kNever);
}

double& SlotTable::earliest(int base) {
    return *std::min_element(free_s_.begin() + first_[base], free_s_.begin() + first_[base + 1]);
}

bool TeamFlights::fly(const FieldProblem& problem, const FieldTeam& team, const ItemList* lists,
                      bool whole) {
    first_.resize(problem.n_uav);
    flights_.resize(problem.n_uav);
    int count = 0;
    for (int uav = 0; uav < problem.n_uav; ++uav) {
        first_[uav] = count;
        count += lists[uav].count;
        flights_[uav] = FieldFlight{};
        flights_[uav].progress = team.begin(problem, uav);
    }
    times_.resize(count);
    arrivals_.clear();
    slots_.reset(problem);
    take_slots_of_landed(problem, team, lists);
    approach(problem, team);
    bool all = true;
    for (int uav = 0; uav < problem.n_uav; ++uav) {
        if (lists[uav].count == 0 || bound_[uav]) continue;
        if (team.active[uav] && team.free_s[uav] < kNever) {
            all &= fly_on(problem, team, lists[uav], uav);
        } else {
            flights_[uav].refusal = Refusal::kIncapable;
            all = false;
        }
        if (whole && !all) return false;
    }
    while (!arrivals_.empty()) {
        std::pop_heap(arrivals_.begin(), arrivals_.end(), later);
        const Arrival arrival = arrivals_.back();
        arrivals_.pop_back();
        const ItemList& list = lists[arrival.uav];
        all &= serve(problem, team, list, arrival) && fly_on(problem, team, list, arrival.uav);
        if (whole && !all) return false;
    }
    return all;
}

double TeamFlights::value() const {
    double value = 0.0;
    for (const FieldFlight& flight : flights_) value += flight.value();
    return value;
}

// Who is bound for a base with slots is served there in its turn.
void TeamFlights::approach(const FieldProblem& problem, const FieldTeam& team) {
    bound_.assign(problem.n_uav, 0);
    for (int uav = 0; uav < problem.n_uav; ++uav) {
        if (!team.active[uav] || !team.is_bound(uav) || !slots_.limited(team.landed_at[uav])) {
            continue;
        }
        bound_[uav] = 1;
        flights_[uav].progress = team.above_base(problem, uav);
        arrivals_.push_back({team.arrives_s[uav], team.rank[uav], uav});
        std::push_heap(arrivals_.begin(), arrivals_.end(), later);
    }
}

// Who stands at a base holds a slot until it departs, or for good if it takes no part. More of them
// than slots are others that wait for their turn: each after one that is ready earlier.
void TeamFlights::take_slots_of_landed(const FieldProblem& problem, const FieldTeam& team,
                                       const ItemList* lists) {
    landed_.clear();
    for (int uav = 0; uav < problem.n_uav; ++uav) {
        const int leaving = team.leaving_base(uav);
        if (leaving >= 0 && slots_.limited(leaving)) {
            double& slot_s = slots_.earliest(leaving);
            slot_s = std::max(slot_s, team.leaves_s[uav]);
        }
        const int base = team.landed_at[uav];
        if (!team.stands_on_slot(uav) || !slots_.limited(base)) continue;
        landed_.push_back({team.free_s[uav], team.rank[uav], uav});
    }
    std::sort(landed_.begin(), landed_.end());
    for (const Arrival& each : landed_) {
        double until_s = team.active[each.uav] ? each.arrive_s : kNever;
        if (team.active[each.uav] && lists[each.uav].count > 0) {
            const Progress& progress = flights_[each.uav].progress;
            until_s = departure_s(problem, progress, lists[each.uav].items[0]);
        }
        double& slot_s = slots_.earliest(team.landed_at[each.uav]);
        slot_s = std::max(slot_s, until_s);
    }
}

// On through the list up to the arrival at a base with slots, or to the way home after its last item
// that can be done; false: there is one that can't be.
bool TeamFlights::fly_on(const FieldProblem& problem, const FieldTeam& team, const ItemList& list,
                         int uav) {
    FieldFlight& flight = flights_[uav];
    Times* const times = times_.data() + first_[uav];
    for (; flight.done < list.count; ++flight.done) {
        const Item item = list.items[flight.done];
        if (is_base(item) && slots_.limited(base_of(item))) {
            const double arrive_s = arrival_s(problem, base_of(item), flight.progress);
            if (arrive_s < kNever) {
                arrivals_.push_back({arrive_s, team.rank[uav], uav});
                std::push_heap(arrivals_.begin(), arrivals_.end(), later);
                return true;
            }
        }
        flight.refusal = do_item(problem, uav, item, flight.progress, times[flight.done]);
        if (flight.refusal != Refusal::kNone) break;
    }
    go_home(problem, list, uav);
    return flight.refusal == Refusal::kNone;
}

void TeamFlights::go_home(const FieldProblem& problem, const ItemList& list, int uav) {
    FieldFlight& flight = flights_[uav];
    if (flight.done == 0) return;
    const int node = node_after(problem, list.items[flight.done - 1]);
    flight.home = problem.home[static_cast<std::size_t>(uav) * problem.n_node + node];
    flight.home_depart_s = flight.progress.time_s;
    flight.home_arrive_s = flight.home_depart_s + problem.home_time_s(uav, node);
}

bool TeamFlights::serve(const FieldProblem& problem, const FieldTeam& team, const ItemList& list,
                        const Arrival& arrival) {
    FieldFlight& flight = flights_[arrival.uav];
    const bool bound = bound_[arrival.uav];
    const int base = bound ? team.landed_at[arrival.uav] : base_of(list.items[flight.done]);
    double& slot_s = slots_.earliest(base);
    const double begin_s = touch_down_s(problem, arrival.uav, arrival.arrive_s, slot_s);
    Times landing{};
    Times& times = bound ? landing : times_[first_[arrival.uav] + flight.done];
    const Refusal refusal = begin_s < kNever ? swap_battery(problem, arrival.uav, base, begin_s,
                                                            flight.progress, times)
                                             : Refusal::kEnergy;
    bound_[arrival.uav] = 0;
    if (refusal != Refusal::kNone) {
        if (list.count == 0) return true;  // without anything to do it is nobody's concern
        flight.refusal = refusal;
        go_home(problem, list, arrival.uav);
        return false;
    }
    if (!bound) ++flight.done;
    slot_s = flight.done < list.count
                 ? departure_s(problem, flight.progress, list.items[flight.done])
                 : flight.progress.time_s;
    return true;
}

}  // namespace peckorder
