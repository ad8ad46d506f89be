// Prices of tasks that suit the lists known so far: the master problem of a Lagrangian bound.
//
// Proximal bundle method with a bundle for every UAV (disaggregated; Kiwiel 1990,
// doi:10.1007/BF01585731): minimise over prices p >= 0
//
//     Σ_i p_i + Σ_j max(0, max over known lists k of UAV j of worth_k − Σ_{i on k} p_i)
//         + |p − centre|² / (2·step)
//
// by its dual, a concave quadratic in shares x_k >= 0 of lists, Σ x_k <= 1 per UAV, to which prices
// max(0, centre_i − step·(1 − Σ_{k visits i} x_k)) belong. Shares move pairwise within one UAV, from
// the list worth least after paying to the one worth most, as far as is best (sequential minimal
// optimisation: Platt 1998), UAV after UAV.
#pragma once

#include <cstddef>
#include <unordered_map>
#include <utility>
#include <vector>

#include "routes_solution.hpp"
#include "watch.hpp"

namespace peckorder {

class ListBundle {
 public:
  ListBundle(int n_uav, std::vector<double> prices);

  // Knows it already where it was added with the same worth.
  void add(int uav, const Route& list, double worth);

  // Moves shares until no UAV could gain more than `tolerance` by it, `sweeps` times at most.
  void solve(double step, double tolerance, long sweeps, Watch& watch);

  void move_centre(std::vector<double> prices) { centre_ = std::move(prices); }

  const std::vector<double>& prices() const { return prices_; }
  double value() const;       // of the sum above without its last term: no bound, but a guess of it
  std::vector<double> shares() const;  // of all lists but the empty ones, UAV by UAV

 private:
  struct Known {
    Route tasks;  // one as often as it is visited
    double worth, share;
    double left(const std::vector<double>& prices) const {
      double left = worth;
      for (const int task : tasks) left -= prices[task];
      return left;
    }
  };

  double improve(std::vector<Known>& known, double step);
  void set_price(int task, double step);

  std::vector<std::vector<Known>> known_;  // per UAV; the first is the empty list
  std::vector<std::unordered_multimap<std::size_t, std::size_t>> at_;  // in known_, by a hash
  std::vector<double> centre_, prices_, visits_;
  std::vector<int> difference_;
};

}  // namespace peckorder
