// Large-neighbourhood search with annealing on one set of lists.
//
// Slack induction by string removals (Christiaens and Vanden Berghe 2020,
// doi:10.1287/trsc.2019.0914) carried over to eq. 1: near tasks are torn out of a few lists as
// strings and put back one by one where J gains most, now and then overlooking a place.
// The best place for a task on a list is remembered until the list changes, which most lists have not
// done when the task is torn out again. Single-threaded; sharing the work between threads is
// routes_team.hpp's part.
#pragma once

#include <utility>
#include <vector>

#include "routes_lane.hpp"
#include "routes_random.hpp"
#include "routes_solution.hpp"

namespace peckorder {

// Those of the tasks that are on no list and that an allowed UAV can do, most valuable first.
std::vector<int> missing(const Solution& solution, const std::vector<int>& tasks);

// Put these where J gains most, in that order.
void insert_missing(Solution& solution, const std::vector<int>& tasks);

class Search : public Lane {
 public:
  // A ruin takes `mean_torn` tasks on average.
  Search(const Problem& problem, const Start& start, std::uint64_t seed,
         double mean_torn = kMeanTorn);

  // Work on the lists of these UAVs alone; best := current.
  void load(const std::vector<Route>& routes, const std::vector<int>& uavs) override;

  void run(long iterations, double temperature, Watch& watch) override;

  const std::vector<int>& uavs() const override { return current_.allowed(); }
  double best_value() const override { return best_value_; }
  const Route& best_route(int uav) const override { return best_[uav]; }
  const Route& current_route(int uav) const override { return current_.route(uav); }

 private:
  void ruin();
  void tear(int task, double longest);
  void recreate();
  void keep_copy(int uav);
  int places_to_blink();
  Insertion best_insertion(int task, bool may_blink);
  Insertion best_place(int uav, int task);
  Insertion best_unblinked(const Insertion& best, int task);
  Insertion most_gained(int uav) const;

  static constexpr double kMeanTorn = 15.0;

  Solution current_;
  Random random_;
  double mean_torn_;
  int until_blink_ = 1;  // places looked at till the next that is overlooked
  // The best place of a list for a task, which stays so as long as the list does.
  struct Known {
    double gain;
    std::int32_t place;
    std::uint32_t version;  // of the list; versions begin with 1
  };
  std::vector<Known> known_;             // per task and allowed UAV
  std::vector<std::uint32_t> versions_;  // of the lists as they were accepted, per UAV
  std::uint32_t last_version_ = 0;
  std::vector<double> gains_;            // at each place of the list looked at
  std::vector<int> overlooked_;          // places of it
  double best_value_ = 0.0;
  std::vector<Route> best_;
  std::vector<int> tasks_;                     // all tasks on the lists
  std::vector<int> unsaved_;                   // UAVs whose lists changed since best_ was copied
  std::vector<std::uint8_t> is_unsaved_;
  struct Torn {
    int task;
    double completion_s;  // where it was
  };
  std::vector<Torn> torn_;                     // tasks taken out in this iteration
  std::vector<std::pair<double, int>> order_;  // in which they are put back
  std::vector<int> touched_;                   // UAVs whose lists changed in this iteration
  std::vector<std::uint8_t> is_touched_;
  std::vector<Solution::Copy> copies_;         // their lists before, in the order of touched_
  double value_before_ = 0.0;                  // Σ of their values before
};

}  // namespace peckorder
