// The list of one UAV by the order of its tasks alone: at which bases it swaps batteries between
// them, and which way it flies lines, follows from that order by label-setting.
//
// A label is a Progress after the same tasks in the same order; one that is earlier, has the later
// end of its sortie and is worth more makes another one needless. Each list keeps its labels after
// every task, so a change is valued from its place on only.
#pragma once

#include <cstdint>
#include <vector>

#include "field_team.hpp"
#include "routes_random.hpp"

namespace peckorder {

// A UAV at a base with fewer slots than there are UAVs.
struct Stay {
    int base;
    double arrive_s, leave_s;
};

// Until when somebody without a list keeps the slot of the base at which it stands: it leaves when it
// is free, or never if it takes no part.
inline double idle_until_s(const FieldTeam& team, int uav) {
    return team.active[uav] ? team.free_s[uav] : std::numeric_limits<double>::infinity();
}

// Who holds slots when, as it is now believed. Who arrives waits for those that arrived earlier;
// that it makes later ones wait is not seen here, but where all lists are flown together.
class Stays {
  public:
    Stays(const FieldProblem& problem, const FieldTeam& team, std::uint64_t& last_version)
        : problem_(&problem),
          team_(&team),
          last_version_(&last_version),
          of_(problem.n_uav),
          at_(problem.n_base) {}

    bool limited(int base) const {
        return problem_->slots[base] > 0 && problem_->slots[base] < problem_->n_uav;
    }
    double begin_s(int base, int uav, double arrive_s) const;
    void set(int uav, const std::vector<Stay>& stays);
    std::uint64_t version() const { return version_; }  // the same only if the stays are the same

  private:
    struct Held {
        Arrival arrival;
        double leave_s, latest_s;  // when it leaves; when the last one of it and those before does
    };
    void arrange(int base);

    const FieldProblem* problem_;
    const FieldTeam* team_;
    std::uint64_t* last_version_;
    std::vector<std::vector<Stay>> of_;
    std::vector<std::vector<Held>> at_;  // by base, in the order of arrival
    std::uint64_t version_ = 0;
    mutable std::vector<double> leaves_s_;
};

struct ListLabel {
    Progress progress;
    std::int32_t parent;  // among the labels after the task before
    Item item;            // the task, in the direction in which it was done
    std::int32_t base;    // where the battery was swapped last since the task before; -1: nowhere
};

// What is known of a task on a list without its labels: bounds on what changes before it may give.
struct OnList {
    double end_s;      // the earliest end of its work
    double step_s;     // at least so long from the task before
    double work_s;     // at least so long along it, with its service
    double opens_s, last_s;  // within these its work begins
    double share, until_s;   // its value is share * (until_s - end)
    double rest;       // the most that it and those after it are worth
    double slope;      // so much less they are worth for each second that they come later
};

// What the tasks after one on a list can be worth with what is left of the battery after it: if that
// lasts `need_s` and the time is t, at most `gain` less the slope times t. Windows, due times and
// slots are left out of account, which only make them worth less.
struct Charged {
    double need_s, gain;
};

struct FieldList {
    int uav = 0;
    std::vector<Item> order;    // tasks, in the directions now chosen
    std::vector<Item> items;    // with the bases
    std::vector<ListLabel> labels;  // after each task, end to end
    std::vector<int> offsets;   // labels after k tasks: offsets[k] .. offsets[k + 1] - 1
    double value = 0.0;         // as its labels believe
    bool meets_slots = false;   // whether a limited base was thought of
    std::uint64_t version = 0;  // the same only if the order and the labels are the same
    std::uint64_t stays_version = 0;
    std::vector<OnList> on;     // by task, if `known` is `version`
    std::uint64_t known = 0;
    // The same where batteries are swapped: after each task, in each direction, less need and gain
    // first; and from each base, to each task with those after it.
    std::vector<Charged> charged;
    std::vector<int> charged_offsets;
    std::vector<double> from_base;
    std::vector<double> rest;   // of each label: at most so much more it comes to
    bool is_charged = false;    // whether that is known
    bool is_charged_exact = false;  // whether they are worth just that
};

// What a task gains at a place of a list.
struct ItemInsertion {
    double gain = -std::numeric_limits<double>::infinity();
    std::size_t place = 0;
    int uav = -1;

    // The smaller index first of what gains as much.
    bool operator<(const ItemInsertion& other) const {
        if (gain != other.gain) return gain < other.gain;
        return uav != other.uav ? uav > other.uav : place > other.place;
    }
};

// Solves lists; has the room it needs to work.
class ListSolver {
  public:
    ListSolver(const FieldProblem& problem, const FieldTeam& team, std::uint64_t& last_version)
        : problem_(problem),
          team_(team),
          last_version_(last_version),
          ready_(problem.n_base),
          before_(problem.n_base),
          hops_s_(static_cast<std::size_t>(problem.n_base) * problem.n_base) {}

    // Work out labels and items of the first `kept` tasks' successors anew; false: the order can't
    // be done, and then the list holds no items. While `overlooks` > 0, a swap is overlooked with
    // that probability.
    bool solve(FieldList& list, const Stays& stays, std::size_t kept, Random* random = nullptr,
               double overlooks = 0.0);

    // Whether `task` can be done by a UAV alone; its list is empty.
    bool can_do(const FieldList& list, const Stays& stays, int task);

    // Where `task` gains most.
    ItemInsertion best_place(FieldList& list, const Stays& stays, int task, bool& meets_slots);

    // Append what `task` gains at most at every place of the list.
    void bound_places(FieldList& list, int task, std::vector<ItemInsertion>& bounds);

    // What `task` gains at that place of a list whose places were bounded, if that is more than
    // `least`; else -infinity.
    double gain_at(const FieldList& list, const Stays& stays, std::size_t place, int task,
                   double least, bool& meets_slots);

    // Have at hand soon what bounding the places takes.
    void fetch(const FieldList& list, int task) const;

    // The same list under other stays: its labels and value anew, but no other bases. Where it can't
    // be done under these its value is -infinity.
    void refresh(FieldList& list, const Stays& stays);

    // ListLabel extensions so far: a measure of the work done.
    std::int64_t steps = 0;

  private:
    bool swaps(int uav) const {
        return problem_.n_base > 0 && std::isfinite(problem_.full_s[uav]) &&
               problem_.full_s[uav] > 0.0;
    }
    void learn(FieldList& list);
    double most_charged_with(const FieldList& list, std::size_t place, int task);
    double longer_s(const FieldList& list, std::size_t to, const double* from_s,
                    const double* than_s) const;
    bool is_free(const FieldList& list) const;
    void learn_hops(int uav);
    void learn_charged(FieldList& list);
    const Charged* charged_of(const FieldList& list, std::size_t number, int way,
                              const Charged*& end) const;
    template <typename Take>
    void for_each_charged(const FieldList& list, std::size_t to, const double* legs_s,
                          Take take) const;
    double most_unswapped(const FieldList& list, std::size_t to, const double* legs_s,
                          double charge_s) const;
    double most_after(const FieldList& list, std::size_t number, Item item, double charge_s) const;
    double most_from(const FieldList& list, std::size_t from, const Progress& now) const;
    double charge_s(int uav, const Progress& now) const {
        return now.landed ? problem_.full_s[uav] : now.sortie_end_s - now.time_s;
    }
    double least_leg_s(int uav, int from, int to) const;
    double most_value(const FieldList& list, std::size_t from, double time_s, double survival) const;
    double most_with(const FieldList& list, std::size_t place, int task);
    double value_with(const FieldList& list, const Stays& stays, std::size_t place, int task,
                      double least, bool& meets_slots);
    void extend(int uav, const Stays& stays, const ListLabel* from, int count, int task,
                std::vector<ListLabel>& into, bool& meets_slots);
    void reach_bases(int uav, const Stays& stays, const Progress& from, bool& meets_slots);
    bool hop(int uav, const Stays& stays, const Progress& from, int base, bool& meets_slots,
             Progress& ready);
    bool try_task(int uav, const Progress& from, int parent, int base, int task,
                  std::vector<ListLabel>& into);
    void write_items(FieldList& list, const Stays& stays, int last);

    const FieldProblem& problem_;
    const FieldTeam& team_;
    std::uint64_t& last_version_;
    std::vector<Progress> ready_;  // after a swap at each base
    std::vector<int> before_;      // the base before that one; -1: none, -2: can't be reached
    std::vector<ListLabel> here_, next_;
    std::vector<ItemInsertion> bounds_;
    std::vector<double> hops_s_;     // (n_base, n_base) from being ready at a base to another one
    int hops_kind_ = -1;             // for UAVs of that kind, with
    double hops_full_s_ = 0.0;       // such batteries
    std::vector<double> unswapped_;
    std::vector<Charged> steps_;
    std::vector<double> bound_;     // of each label at a place
    std::vector<ListLabel> from_;
    Random* random_ = nullptr;
    double overlooks_ = 0.0;
    FieldList before_refresh_;
};

}  // namespace peckorder
