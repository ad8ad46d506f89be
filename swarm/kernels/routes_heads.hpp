// Beginnings of lists, as far as tails (routes_tails.hpp) say that they can lead to the best ones.
#pragma once

#include <queue>
#include <utility>
#include <vector>

#include "routes_offer.hpp"
#include "routes_tails.hpp"

namespace peckorder {

// Best first, by what a beginning earns and what tails add to it at most. Of two that end at one
// task the one is dropped that is later, earns less and remembers more.
class Heads {
 public:
  Heads(const Offer& offer, const Tails& tails) : offer_(offer), tails_(tails), at_(offer.n()) {}

  PricedList search(long most, Watch& watch);

 private:
  struct Head {
    double time_s;  // of completing the last task
    double earned;
    int task, before;  // `before` in heads_
    Memory known;
    bool dropped = false;
  };

  // `head` without what its own task earns.
  void reach(Head head);
  bool enter(int own, const Head& head);
  bool promising(double most) const { return most > best_ * (1.0 + kRounding); }

  static constexpr double kRounding = 1e-12;

  const Offer& offer_;
  const Tails& tails_;
  std::vector<Head> heads_;
  std::vector<std::vector<int>> at_;                // those not dropped, per task
  std::priority_queue<std::pair<double, int>> open_;  // with minus the index: of equals the oldest
  double best_ = 0.0;
  int best_head_ = -1;
};

// All real lists that earn at least `floor`, depth first; gives up after `most` beginnings.
WorthyLists lists_from(const Offer& offer, const Tails& tails, double floor, long most,
                       Watch& watch);

}  // namespace peckorder
