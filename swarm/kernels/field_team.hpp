// The schedules of a whole team's lists: who waits for a slot of a base.
//
// A base serves in the order of arrival, then rank, then index, so all arrivals at bases with slots
// are gone through in that order, and each finds the slots as those before it leave them. Between
// two of them a UAV meets nobody and flies on through its list.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "field.hpp"

namespace peckorder {

struct ItemList {
    const Item* items = nullptr;
    int count = 0;
};

// How far a UAV came with its list, and its way home.
struct FieldFlight {
    Progress progress;                   // after the last item that it did
    int done = 0;                        // items that it did
    Refusal refusal = Refusal::kNone;    // of the one after them
    int home = -1;                       // where it ends: a base, or -1 for its start
    double home_depart_s = 0.0, home_arrive_s = 0.0;  // if it did something

    double value() const { return progress.value; }
};

// An arrival at a base with slots, landed if one is free; the earlier one is served first.
struct Arrival {
    double arrive_s;
    std::int64_t rank;
    int uav;

    bool operator<(const Arrival& other) const {
        if (arrive_s != other.arrive_s) return arrive_s < other.arrive_s;
        if (rank != other.rank) return rank < other.rank;
        return uav < other.uav;
    }
};

// When slots of all bases are free next, a base without a limit having none. More than there are
// UAVs are never needed.
class SlotTable {
 public:
    void reset(const FieldProblem& problem);
    bool limited(int base) const { return first_[base] < first_[base + 1]; }
    // The earliest one of a base that is limited.
    double& earliest(int base);

 private:
    std::vector<int> first_;  // (n_base + 1,)
    std::vector<double> free_s_;
};

// Working memory and result of flying lists, to be used again and again.
class TeamFlights {
 public:
    // Fly (n_uav,) `lists` from where the team stands; true: every item can be done. Told that it is
    // to be `whole`, it ends at the first that can't be. Inactive UAVs do nothing; one that stands
    // at a base keeps its slot. Who is bound for a base lands there first, without a list too.
    bool fly(const FieldProblem& problem, const FieldTeam& team, const ItemList* lists,
             bool whole = false);

    // Of the `index`-th item of a list, if it was done.
    const Times& times(int uav, int index) const { return times_[first_[uav] + index]; }
    const FieldFlight& flight(int uav) const { return flights_[uav]; }
    double value() const;  // of all, added up by index

 private:
    void approach(const FieldProblem& problem, const FieldTeam& team);
    void take_slots_of_landed(const FieldProblem& problem, const FieldTeam& team,
                              const ItemList* lists);
    bool fly_on(const FieldProblem& problem, const FieldTeam& team, const ItemList& list, int uav);
    void go_home(const FieldProblem& problem, const ItemList& list, int uav);
    bool serve(const FieldProblem& problem, const FieldTeam& team, const ItemList& list,
               const Arrival& arrival);

    std::vector<int> first_;
    std::vector<Times> times_;
    std::vector<FieldFlight> flights_;
    std::vector<std::uint8_t> bound_;  // (n_uav,) it has yet to land before its first item
    std::vector<Arrival> arrivals_;  // a heap, the earliest one first
    std::vector<Arrival> landed_;
    SlotTable slots_;
};

// When a UAV takes off to its next item: at once, unless it stands at a base and what comes opens
// later than it would arrive.
inline double departure_s(const FieldProblem& problem, const Progress& progress, Item item) {
    if (!progress.landed || is_base(item)) return progress.time_s;
    const double leg_s = progress.legs_s[problem.enter_node(item)];
    if (!std::isfinite(leg_s)) return progress.time_s;
    return std::max(progress.time_s, problem.opens_s[task_of(item)] - leg_s);
}

// Where a UAV is after an item.
inline int node_after(const FieldProblem& problem, Item item) {
    return is_base(item) ? problem.base_node(base_of(item)) : problem.leave_node(item);
}

}  // namespace peckorder
