// Iterated local search with annealing on one set of lists on which nobody is lost.
//
// Each iteration exchanges two neighbouring parts of a list (double bridge, Martin, Otto and Felten
// 1991) or tears strings out of near lists and puts their tasks back one by one, then descends from
// the tasks beside what was changed, and is taken back if too much is lost by it.
#pragma once

#include <memory>

#include "routes_lane.hpp"
#include "routes_moves.hpp"
#include "routes_random.hpp"

namespace peckorder {

class GranularSearch : public Lane {
 public:
  GranularSearch(const RouteTerms& terms, std::uint64_t seed);

  void load(const std::vector<Route>& routes, const std::vector<int>& uavs) override;
  void run(long iterations, double temperature, Watch& watch) override;

  const std::vector<int>& uavs() const override { return uavs_; }
  double best_value() const override { return best_value_; }
  const Route& best_route(int uav) const override { return best_[uav]; }
  const Route& current_route(int uav) const override;

  // Put what is on no list where it gains most, descend from everywhere; best := current.
  void settle(const std::vector<int>& tasks);

  double mean_delay() const { return lists_.mean_delay(); }

 private:
  void keep(int list);
  void push(int task);
  void push_around(int list, int place);
  void apply(const Recipe& recipe);
  void descend();
  void bridge();
  void ruin();
  void put_back(int task);
  void save_best();

  TimedLists lists_;
  MoveFinder finder_;
  Random random_;
  std::vector<int> uavs_;
  std::vector<int> list_of_uav_;
  std::vector<int> tasks_;
  std::vector<Route> best_;
  double best_value_ = 0.0;
  double least_ = 0.0;
  std::vector<int> queue_;
  std::vector<std::uint8_t> is_queued_, is_touched_, is_unsaved_;
  std::vector<int> touched_, unsaved_, torn_;
  std::vector<Route> copies_;
  Route scratch_;
};

}  // namespace peckorder
