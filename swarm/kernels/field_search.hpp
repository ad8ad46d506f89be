// Large-neighbourhood search with annealing on the lists of a whole team under the field's
// constraints.
//
// Slack induction by string removals (Christiaens and Vanden Berghe 2020,
// doi:10.1287/trsc.2019.0914): near tasks are torn out of a few lists and put back one by one where
// J gains most; tasks may stay out. Lists are orders of tasks, in which field_list.hpp places base
// visits and directions; what a team is worth is said by all of its lists flown together.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "field_list.hpp"
#include "watch.hpp"

namespace peckorder {

using ItemLists = std::vector<std::vector<Item>>;

// Compared by (fewest required tasks left out, then largest J).
struct Worth {
    int left_out = 0;  // required tasks that somebody can do
    double value = 0.0;

    bool operator>(const Worth& other) const {
        return left_out != other.left_out ? left_out < other.left_out : value > other.value;
    }
};

// One line of search, by its own random numbers; on one thread.
class FieldLane {
  public:
    FieldLane(const FieldProblem& problem, const FieldTeam& team, std::uint64_t seed);

    // Go on from these lists, as far as they can be flown.
    void load(const ItemLists& lists);

    // One iteration, a removal and re-insertion, at this temperature; while tasks wait to be placed
    // for the first time, that of one of them.
    void iterate(double temperature);

    const ItemLists& best() const { return best_; }
    const Worth& best_worth() const { return best_worth_; }
    std::int64_t steps() const { return solver_.steps; }
    double scale() const { return scale_; }  // what a displaced task costs, about

  private:
    struct Known {
        std::uint64_t list = 0, stays = 0;
        bool meets_slots = false;
        double most = std::numeric_limits<double>::infinity();  // no place gains more than that;
                                                                // this one does if it is exact
        bool exact = false;
        std::size_t place = 0;
    };

    void find_doable();
    void find_near();
    void ruin();
    void tear_strings();
    void tear(int task, double longest);
    void tear_random();
    void tear_list();
    void tear_about(int task);
    void exchange_tails();
    void swap_anew();
    void recreate();
    void arrange();
    bool put_back(int task);
    void put_back_by_regret();
    Known& known(int uav, int task);
    Known& known_now(int uav, int task);
    ItemInsertion best_place(int uav, int task);
    ItemInsertion best_place(int task, double least);
    void insert(int uav, std::size_t place, int task);
    void remove(int uav, std::size_t from, std::size_t count);
    void settle(int uav, std::size_t kept, double overlooks = 0.0);
    void believe_stays(int uav);
    void believe_stays(int uav, const Times* times, std::size_t count);
    bool fly();
    void fly_together();
    Worth worth() const;
    void touch(int uav);
    void move(int task, int uav, bool noted = true);
    void undo();
    void note_best(const Worth& now);

    const FieldProblem& problem_;
    const FieldTeam& team_;
    Random random_;
    std::uint64_t last_version_ = 0;
    ListSolver solver_;
    TeamFlights flights_;
    std::vector<ItemList> flown_;
    Stays stays_;
    bool any_limited_ = false;
    bool any_swaps_ = false;
    bool precise_ = false;  // in this iteration

    std::vector<FieldList> lists_;
    std::vector<double> value_;  // of the lists, flown together
    std::vector<int> uavs_;      // that may be given tasks
    std::vector<int> tasks_;     // open, and that somebody can do alone
    std::vector<std::vector<int>> near_;
    std::vector<std::vector<int>> able_;  // UAVs by task
    std::vector<double> weight_;          // the largest of all UAVs, by task
    std::vector<int> list_of_;            // by task; -1: on none
    std::vector<int> out_, place_out_;    // tasks on no list, and where each is among these
    std::size_t placed_ = 0;              // tasks that had their first turn
    std::vector<Known> known_;            // (n_uav, n_task)
    std::vector<int> asked_;
    std::vector<ItemInsertion> bounds_;  // a heap
    std::vector<Times> times_;
    std::vector<Stay> own_stays_;
    double scale_ = 0.0;
    double prize_ = 0.0;

    // What this iteration changed.
    std::vector<int> torn_;
    std::vector<std::pair<int, int>> moved_;  // tasks, and the lists they were on
    std::vector<int> touched_;
    std::vector<std::uint8_t> is_touched_;
    std::vector<FieldList> copies_;
    std::vector<double> value_before_;
    Stays stays_before_;
    std::vector<std::pair<double, int>> order_;
    std::vector<std::size_t> cut_;

    ItemLists best_;
    Worth best_worth_;
};

// Several lanes with one result, whatever the number of threads.
class FieldSearch {
  public:
    FieldSearch(const FieldProblem& problem, const FieldTeam& team, const ItemLists& lists,
                std::uint64_t seed);

    // So many iterations per lane; heat within 0..1, 1 at the beginning of the annealing. Ended
    // early by the watch.
    void round(long iterations, double heat, int threads, Watch& watch);

    // Let every lane go on from the best lists.
    void gather();

    int n_lane() const { return static_cast<int>(lanes_.size()); }

    // Of all lanes in all rounds, in steps as a Watch counts them; the same with any number of
    // threads.
    std::int64_t work() const;

    const ItemLists& best() const { return best_; }
    const Worth& best_worth() const { return best_worth_; }

  private:
    std::vector<std::unique_ptr<FieldLane>> lanes_;
    std::vector<std::int64_t> work_;  // of each lane
    ItemLists best_;
    Worth best_worth_;
};

}  // namespace peckorder
