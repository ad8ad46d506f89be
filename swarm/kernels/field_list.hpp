// The list of one UAV by the order of its tasks alone: at which bases it swaps batteries between
// them, and which way it flies lines, follows from that order by label-setting.
//
// A label is a Progress after the same tasks in the same order; one that is earlier, has the later
// end of its sortie and is worth more makes another one needless. Each list keeps its labels after
// every task, so a change is valued from its place on only.
#pragma once

#include <cstdint>
#include <vector>

#include "field.hpp"
#include "routes_random.hpp"

namespace peckorder {

// A UAV at a base with fewer slots than there are UAVs.
struct Stay {
    int base;
    double arrive_s, leave_s;
};

// Who holds slots when, as it is now believed. Who arrives waits for those that arrived earlier;
// that it makes later ones wait is not seen here, but by TeamFlight.
class Stays {
  public:
    Stays(const FieldProblem& problem, const FieldTeam& team, std::uint64_t& last_version)
        : problem_(&problem), team_(&team), last_version_(&last_version), of_(problem.n_uav) {}

    bool limited(int base) const {
        return problem_->slots[base] > 0 && problem_->slots[base] < problem_->n_uav;
    }
    double begin_s(int base, int uav, double arrive_s) const;
    void set(int uav, const std::vector<Stay>& stays);
    const std::vector<Stay>& of(int uav) const { return of_[uav]; }
    std::uint64_t version() const { return version_; }  // the same only if the stays are the same

  private:
    const FieldProblem* problem_;
    const FieldTeam* team_;
    std::uint64_t* last_version_;
    std::vector<std::vector<Stay>> of_;
    std::uint64_t version_ = 0;
    mutable std::vector<double> leaves_s_;
};

struct ListLabel {
    Progress progress;
    std::int32_t parent;  // among the labels after the task before
    Item item;            // the task, in the direction in which it was done
    std::int32_t base;    // where the battery was swapped last since the task before; -1: nowhere
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
};

// Solves lists; has the room it needs to work.
class ListSolver {
  public:
    ListSolver(const FieldProblem& problem, const FieldTeam& team, std::uint64_t& last_version)
        : problem_(problem),
          team_(team),
          last_version_(last_version),
          ready_(problem.n_base),
          before_(problem.n_base) {}

    // Work out labels and items of the first `kept` tasks' successors anew; false: the order can't
    // be done, and then the list holds no items. While `overlooks` > 0, a swap is overlooked with
    // that probability.
    bool solve(FieldList& list, const Stays& stays, std::size_t kept, Random* random = nullptr,
               double overlooks = 0.0);

    // The value of the list with `task` before its task number `place`; -infinity: can't be done.
    double value_with(const FieldList& list, const Stays& stays, std::size_t place, int task,
                      bool& meets_slots);

    // The same list under other stays: its labels and value anew, but no other bases.
    void refresh(FieldList& list, const Stays& stays);

    // ListLabel extensions so far: a measure of the work done.
    std::int64_t steps = 0;

  private:
    bool swaps(int uav) const {
        return problem_.n_base > 0 && std::isfinite(problem_.full_s[uav]) &&
               problem_.full_s[uav] > 0.0;
    }
    void extend(int uav, const Stays& stays, const ListLabel* from, int count, int task,
                std::vector<ListLabel>& into, bool& meets_slots);
    void reach_bases(int uav, const Stays& stays, const Progress& from, bool& meets_slots);
    bool hop(int uav, const Stays& stays, const Progress& from, int base, bool& meets_slots,
             Progress& ready);
    void try_task(int uav, const Progress& from, int parent, int base, int task,
                  std::vector<ListLabel>& into);
    void write_items(FieldList& list, const Stays& stays, int last);

    const FieldProblem& problem_;
    const FieldTeam& team_;
    std::uint64_t& last_version_;
    std::vector<Progress> ready_;  // after a swap at each base
    std::vector<int> before_;      // the base before that one; -1: none, -2: can't be reached
    std::vector<ListLabel> here_, next_;
    Random* random_ = nullptr;
    double overlooks_ = 0.0;
};

// All lists flown together, as slots make them wait.
class TeamFlight {
  public:
    TeamFlight(const FieldProblem& problem, const FieldTeam& team)
        : problem_(problem), team_(team), pilots_(problem.n_uav), free_s_(problem.n_base) {}

    // Whether list `uav` takes part: others neither wait nor make wait.
    static bool takes_part(const FieldTeam& team, const Stays& stays, const FieldList& list);

    // Fly those that take part; `value` and `stays` of these are set. The UAV whose list can't be
    // done, or -1; `failed_at` is then the item that it can't do.
    int fly(const std::vector<FieldList>& lists, Stays& stays, std::vector<double>& value,
            std::size_t& failed_at);

  private:
    struct Pilot {
        int uav;
        Progress progress;
        std::size_t next;
        double arrive_s;   // above the base that is next
        bool waits;
        std::vector<Stay> stays;
    };
    bool fly_on(const FieldList& list, const Stays& stays, Pilot& pilot, double& depart_s);

    const FieldProblem& problem_;
    const FieldTeam& team_;
    std::vector<Pilot> pilots_;
    std::vector<std::vector<double>> free_s_;  // of each base's slots
};

}  // namespace peckorder
