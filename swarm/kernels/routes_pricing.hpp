// The best list of each UAV against prices of tasks, exact in time: what a Lagrangian bound sums up.
//
// A list earns Σ w·(D − t) − price over its tasks. Lists are taken from a set a little larger than
// the real ones: a task may come again once its list has left the tasks around it (ng-routes:
// Baldacci, Mingozzi, Roberti 2011, doi:10.1287/opre.1110.0975). Survival is left out (1). First
// tails of lists are joined from their ends (routes_tails.hpp); what they can add at most guides a
// search among beginnings (routes_heads.hpp). See coordinator/planner/bound.py.
#pragma once

#include <algorithm>
#include <cstddef>
#include <map>
#include <utility>
#include <vector>

#include "routes_solution.hpp"
#include "watch.hpp"

namespace peckorder {

// What is asked of `price_lists` and `worthy_lists`.
struct ListPricing {
  const std::vector<int>& open;       // tasks
  const std::vector<double>& prices;  // (n_task,)
  long heads;                         // beginnings of lists that are continued at most, per UAV
  int near;                           // legs only to so many tasks nearest to each; 0: to all
  double slack;                       // tasks that lose no more than this are looked at, too
  int threads;
};

struct PricedList {
  double bound = 0.0;  // no list is worth more after paying
  double worth = 0.0;  // before paying, of the list
  Route list;          // the best, or one that might be: a task may come twice on it
};

// One per UAV, the inactive ones included. The same for any number of threads; of no use once the
// watch has stopped it.
std::vector<PricedList> price_lists(const Problem& problem, const Start& start,
                                    const ListPricing& pricing, Watch& watch);

struct WorthyLists {
  bool all = true;  // none is missing
  std::vector<Route> lists;
  std::vector<double> worth;  // of each, before paying
};

// The best list of each set of tasks.
class BestLists {
 public:
  void keep(const Route& list, double worth) {
    Route tasks = list;
    std::sort(tasks.begin(), tasks.end());
    auto& best = best_[tasks];
    if (best.second.empty() || worth > best.first) best = {worth, list};
  }

  WorthyLists found(bool all) const {
    WorthyLists found;
    found.all = all;
    for (const auto& [tasks, list] : best_) {
      found.lists.push_back(list.second);
      found.worth.push_back(list.first);
    }
    return found;
  }

 private:
  std::map<Route, std::pair<double, Route>> best_;  // by their tasks in order
};

// Per UAV all real lists, the empty one apart, that earn at least `most` of it less the slack, where
// no list earns more than `most`; of those with the same tasks the best.
std::vector<WorthyLists> worthy_lists(const Problem& problem, const Start& start,
                                      const ListPricing& pricing,
                                      const std::vector<double>& most, Watch& watch);

}  // namespace peckorder
