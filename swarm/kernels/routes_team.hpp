// The search of a whole team, on several threads with one result.
//
// A round hands every lane some UAVs and their lists, runs the lanes' searches side by side and
// joins what they found; J is a sum over UAVs, so parts are found apart and added. How UAVs are
// divided follows from the seed and the team alone, never from the number of threads. Small teams
// are not divided: each lane then searches the whole by its own random numbers; on one long list
// it begins anew from the best of all lanes once it has fallen far behind.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "routes_granular.hpp"
#include "routes_search.hpp"
#include "watch.hpp"

namespace peckorder {

// How a search cools.
struct Annealing {
  double hottest;  // of the mean delay
  double ratio;    // of one temperature to the one before, of 65
  double iterations_for_full_heat;  // per task; see TeamSearch
  double torn;     // tasks that a ruin takes on average; of no matter to long lists
};

class TeamSearch {
 public:
  // Long lists on which nobody is lost are searched by GranularSearch, others by Search. `given` may
  // be null and must live longer, as must the others.
  TeamSearch(const Problem& problem, const Start& start, std::vector<Route> lists,
             const std::vector<int>& tasks, std::uint64_t seed, const GivenTimes* given = nullptr);

  TeamSearch(const TeamSearch&) = delete;
  TeamSearch& operator=(const TeamSearch&) = delete;

  // `iterations` per lane, fewer if the watch stops them; heat within 0..1, 1 at the beginning of
  // the annealing, 0 at its end.
  void round(long iterations, double heat, int threads, Watch& watch);

  // Iterations per lane that take some 10 ms, and per task that an annealing from full heat takes.
  // 0: it pays with however few, and gets as far as local search in less time.
  long most_iterations() const { return most_iterations_; }
  double iterations_for_full_heat() const { return annealing_.iterations_for_full_heat; }

  // Local search on the best lists, until no move gains or the watch stops it; the search goes on
  // from there.
  void polish(Watch& watch);

  double best_value() const { return best_value_; }
  const std::vector<Route>& best() const { return best_; }
  int n_lane() const { return static_cast<int>(lanes_.size()); }

 private:
  struct Middle {  // of a UAV's list
    double x_m, y_m;
    int uav;
  };

  void divide();
  void divide(Middle* from, Middle* to, int lane, int lanes, double east, double north);
  void join(double temperature);

  const Problem& problem_;
  const Start& start_;
  Random random_;
  std::vector<int> uavs_;
  std::optional<RouteTerms> terms_;  // of granular lanes
  bool given_;
  std::vector<std::unique_ptr<Lane>> lanes_;
  bool divided_;
  std::vector<Route> current_, best_;
  double best_value_;
  double hottest_;
  long most_iterations_;
  Annealing annealing_;
};

}  // namespace peckorder
