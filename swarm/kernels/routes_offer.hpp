// The tasks that are worth doing to one UAV at given prices, and what it needs for them.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "routes_pricing.hpp"

namespace peckorder {

// Of the tasks around one, itself the lowest bit, those that a list has been to.
using Memory = std::uint32_t;

// Times count from when the UAV is free; task indices are those of `tasks`.
//
// By the triangle inequality leaving a task out makes no other later. So in the best list of all
// every task earns something, and in one that earns less by no more than a slack no task loses more
// than that. Hence task i ends between `first_s[i]`, by a flight straight from the start, and
// `latest_s[i]`, when it would lose the slack; tasks that always lose as much are left out.
class Offer {
 public:
  struct Arc {
    double reach_s;  // end of the later task, if the earlier one comes first on the list
    int from;        // the earlier one
  };

  Offer(const Problem& problem, const Start& start, int uav, const ListPricing& pricing,
        Watch& watch);

  std::vector<int> tasks;
  std::vector<double> weight, price, first_s, latest_s;
  double left_s;         // until the horizon
  double beside = 0.0;   // most that tasks can earn that are too many to be looked at

  int n() const { return static_cast<int>(tasks.size()); }
  double leg_s(int from, int to) const { return problem_.leg_s(uav_, tasks[from], tasks[to]); }
  double gain(int i, double time_s) const { return weight[i] * (left_s - time_s) - price[i]; }

  double price_of(int task) const { return prices_[task]; }  // of all tasks, not of `tasks`

  // Arcs into a task along which it can end before `latest_s`, soonest first.
  const Arc* arcs_begin(int to) const { return arcs_.data() + arcs_end_[to]; }
  const Arc* arcs_end(int to) const { return arcs_.data() + arcs_end_[to + 1]; }

  // Whereto legs may lead: use(next), next in ascending order or nearest first.
  template <typename Use>
  void for_next(int i, const Use& use) const {
    if (near_ == 0) {
      for (int next = 0; next < n(); ++next)
        if (next != i) use(next);
    } else {
      const int* around = &around_[static_cast<std::size_t>(i) * memory_];
      for (int k = 1; k < std::min(near_ + 1, memory_) && around[k] >= 0; ++k) use(around[k]);
    }
  }

  // How many of the tasks around it matter to tails that begin with a task, and to beginnings.
  int tail_memory(int i) const { return tail_memory_[i]; }
  int head_memory() const { return memory_; }

  // What is still known at `to` of what was known at `from`; `to` itself is.
  Memory moved(Memory known, int from, int to, int memory) const;
  bool knows(Memory known, int at, int task, int memory) const {
    const int place = place_[static_cast<std::size_t>(at) * n() + task];
    return place > 0 && place <= memory && (known >> (place - 1) & 1) != 0;
  }

 private:
  void choose(const Start& start, const ListPricing& pricing);
  void look_around();
  void join(Watch& watch);

  const Problem& problem_;
  const std::vector<double>& prices_;
  int uav_;
  int near_;
  int memory_ = 1;
  std::vector<int> around_;          // (n, memory_) each task and those nearest to it
  std::vector<std::uint8_t> place_;  // (n, n) 1 + where in the row of `around_`; 0: not there
  std::vector<int> tail_memory_;
  std::vector<Arc> arcs_;
  std::vector<std::size_t> arcs_end_;
};

}  // namespace peckorder
