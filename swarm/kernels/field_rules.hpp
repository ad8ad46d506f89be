// A team that decides item by item: events in the order of time, and the rules that decide.
//
// Events of one instant: first slots that become free, then decisions, by rank and index, then
// arrivals at bases, likewise. A UAV decides when it is free to depart: at the end of a task, or when
// it stands ready at a base.
#pragma once

#include <cstdint>
#include <tuple>
#include <vector>

#include "field.hpp"
#include "field_lookahead.hpp"
#include "field_team.hpp"
#include "watch.hpp"

namespace peckorder {

enum class FieldRule : int { kGreedy = 0, kLookahead = 1, kNearest = 2, kValuePerTime = 3 };

// What a UAV does next.
struct FieldChoice {
    bool home = true;  // nothing more
    Item item = 0;
    bool has_score = false, has_second = false;  // scores are of tasks
    double score = 0.0, second = 0.0;  // by the rule, of it and of the next best task; lookahead:
                                       // what the own list is worth
    Times times{};                     // of a base as far as others are known to wait there
};

// Which slots are held until when, and who is on the way to a base, as known at one moment.
class BaseTraffic {
 public:
    void reset(const FieldProblem& problem, const FieldTeam& team);
    void clear(const FieldProblem& problem);  // every slot is free, always
    bool limited(int base) const { return limit_[base] > 0; }
    bool any_free(int base) const { return held_[base] < limit_[base]; }

    void approach(int uav, int base, const Arrival& arrival, double sortie_end_s);
    void give_up(int uav) { at_[uav].stage = Stage::kElsewhere; }
    void hold(int uav, int base, double until_s);  // it has touched down
    void stays(int uav, double until_s) { at_[uav].until_s = until_s; }
    void leave(int uav);  // of a holder
    bool holds(int uav) const { return at_[uav].stage == Stage::kHolding; }
    int base_of_holder(int uav) const { return at_[uav].base; }

    // When who is on the way to a base touches down, if it takes a slot that is free now.
    double lands_s(const FieldProblem& problem, int uav);

    // When there would be a slot for who arrives like that: those ahead that are known stay no
    // longer than their swap takes.
    double begin_s(const FieldProblem& problem, int base, const Arrival& arrival);

 private:
    enum class Stage : std::uint8_t { kElsewhere, kApproaching, kHolding };
    struct At {
        Stage stage = Stage::kElsewhere;
        int base = -1;
        double until_s = 0.0;  // of who holds a slot
        Arrival arrival{};     // of who does not yet
        double sortie_end_s = 0.0;
    };

    void find_free(int base);

    std::vector<At> at_;             // (n_uav,)
    std::vector<int> limit_, held_;  // (n_base,); limit 0: none
    std::vector<std::vector<double>> left_s_;  // (n_base,) when slots were left, in that order
    std::vector<double> slot_s_;
    std::vector<int> ahead_;
};

// One UAV's view when it decides.
struct FieldView {
    const FieldProblem& problem;
    const std::vector<int>& open;  // tasks, in ascending order
    int uav;
    std::int64_t rank;
    const Progress& progress;
    int here;  // the base at which it stands ready, or -1
};

// Whether a UAV may visit a base: as its next item, only behind a task, or not at all.
enum class Swaps : std::uint8_t { kNow, kLater, kNever };

// Rules with their working memory.
class FieldDecider {
 public:
    // By `rule`; may be infeasible only in as far as `traffic` turns out to be another.
    FieldChoice decide(FieldRule rule, const FieldView& view, BaseTraffic& traffic, Swaps swaps);
    void forget() { known_.clear(); }  // what it keeps of one run of one problem

 private:
    // An own best list, and all that it follows from.
    struct KnownPlan {
        int uav, here;
        bool may_swap;
        Progress progress;
        std::vector<int> open;
        OwnPlan plan;

        bool answers(const FieldView& view, bool swaps) const;
    };

    // The open task with the largest score; else to a base, if a swap opens one; else home.
    FieldChoice by_score(FieldRule rule, const FieldView& view, BaseTraffic& traffic, Swaps swaps);
    FieldChoice lookahead(const FieldView& view, BaseTraffic& traffic, Swaps swaps);
    const OwnPlan& own_list(const FieldView& view, bool may_swap);
    std::vector<Item> greedy_list(const FieldView& view, bool may_swap);
    FieldChoice task(FieldRule rule, const FieldView& view) const;
    FieldChoice base(const FieldView& view, BaseTraffic& traffic);
    bool opens_any(const FieldView& view, const Progress& progress) const;

    struct Label {
        Progress progress;
        Times first{};     // times of its first base
        int first_base = -1;
        bool reached = false, settled = false;
    };
    std::vector<Label> labels_;  // (n_base,)
    BaseTraffic nobody_;
    std::vector<KnownPlan> known_;
};

struct FieldDecision {
    int uav;
    double decided_s;
    FieldChoice choice;
};

// A whole run, by lists that `TeamFlights` flies alike.
class FieldRun {
 public:
    // Every base visit of the lists is followed by a task: the earliest visit in vain is barred, and
    // all go on anew from there. So a run from any state that a run has passed goes on like it. Told
    // to stop, all go home from where they are. Asked for what `first` decides first, or goes home,
    // it ends when that is certain.
    void run(const FieldProblem& problem, const FieldTeam& team, FieldRule rule, Watch& watch,
             int first = -1);

    const std::vector<FieldDecision>& decisions() const { return decisions_; }  // in their order

 private:
    enum class Kind : std::uint8_t { kRelease, kDecision, kArrival };
    struct Event {
        double time_s;
        Kind kind;
        std::int64_t rank;
        int uav;
    };
    struct Uav {
        Progress progress;
        int n_item, n_since_task;  // on its list; visits to bases at its end
        int base;                  // to which it flies, or where it stands; or -1
        int n_before = 0;          // visits to bases that it began with, no task since
        double visit_s = 0.0;      // when it decided on the first of the visits at its end
    };
    // A visit that was in vain: at its `n_item`-th decision that UAV may fly to no base.
    struct Bar {
        double time_s;
        std::int64_t rank;
        int uav, n_item;

        bool operator<(const Bar& other) const {
            return std::tie(time_s, rank, uav, n_item) <
                   std::tie(other.time_s, other.rank, other.uav, other.n_item);
        }
    };

    void once(const FieldProblem& problem, const FieldTeam& team, FieldRule rule, Watch& watch,
              int first);
    void begin(const FieldProblem& problem, const FieldTeam& team);
    bool bar_a_visit();
    bool barred(int uav) const;
    void push(double time_s, Kind kind, int uav);
    void decide(const FieldProblem& problem, FieldRule rule, int uav, Watch& watch);
    void touch_down(const FieldProblem& problem, int uav, double begin_s);
    void release(const FieldProblem& problem, int uav);
    static bool later(const Event& a, const Event& b);

    std::vector<Uav> uavs_;
    std::vector<int> open_;
    std::vector<Bar> bars_;
    int n_run_ = 0;
    std::vector<std::vector<int>> waiting_;  // by base, in the order of arrival
    std::vector<Event> events_;              // a heap, the next one first
    std::vector<FieldDecision> decisions_;
    std::vector<std::uint8_t> decided_;      // (n_uav,)
    int n_in_vain_ = 0;                      // UAVs whose last visit no task follows so far
    const std::int64_t* rank_ = nullptr;
    BaseTraffic traffic_;
    FieldDecider decider_;
};

}  // namespace peckorder
