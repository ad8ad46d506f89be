#include "routes_heads.hpp"

#include <algorithm>

namespace peckorder {

PricedList Heads::search(long most, Watch& watch) {
  const int n = offer_.n(), memory = offer_.head_memory();
  for (int i = 0; i < n; ++i) reach({offer_.first_s[i], 0.0, i, -1, 1});
  long continued = 0;
  double left = 0.0;  // of what was not continued
  while (!open_.empty()) {
    const auto [bound, minus] = open_.top();
    if (!promising(bound)) break;
    if (continued == most) {
      left = bound;
      break;
    }
    open_.pop();
    const Head head = heads_[-minus];
    if (head.dropped) continue;
    ++continued;
    if (watch.stops_after(n * 8)) return {};
    offer_.for_next(head.task, [&, before = -minus](int next) {
      if (offer_.knows(head.known, head.task, next, memory)) return;
      const double time_s = head.time_s + offer_.leg_s(head.task, next);
      if (time_s < offer_.latest_s[next])
        reach({time_s, head.earned, next, before,
               offer_.moved(head.known, head.task, next, memory)});
    });
  }
  PricedList found;
  found.bound = std::max(best_, left);
  // Cut short, the list that may be as good as the bound tells more than the best one found.
  const int last = left > best_ ? -open_.top().second : best_head_;
  for (int k = last; k >= 0; k = heads_[k].before)
    found.list.push_back(offer_.tasks[heads_[k].task]);
  std::reverse(found.list.begin(), found.list.end());
  if (left > best_) {
    const Head& head = heads_[last];
    tails_.append_best(head.task, head.time_s, head.known, found.list);
  }
  found.worth = found.bound;
  for (const int task : found.list) found.worth += offer_.price_of(task);
  return found;
}

void Heads::reach(Head head) {
  const double bound = head.earned + tails_.best(head.task, head.time_s, head.known);
  if (!promising(bound)) return;
  head.earned += offer_.gain(head.task, head.time_s);
  const int own = static_cast<int>(heads_.size());
  if (!enter(own, head)) return;
  heads_.push_back(head);
  if (head.earned > best_) {
    best_ = head.earned;
    best_head_ = own;
  }
  if (bound > head.earned) open_.emplace(bound, -own);
}

bool Heads::enter(int own, const Head& head) {
  const auto as_good = [](const Head& a, const Head& b) {
    return a.time_s <= b.time_s && a.earned >= b.earned && (a.known & ~b.known) == 0;
  };
  std::vector<int>& others = at_[head.task];
  for (const int other : others)
    if (as_good(heads_[other], head)) return false;
  const auto overtaken = [&](int other) {
    return heads_[other].dropped = as_good(head, heads_[other]);
  };
  others.erase(std::remove_if(others.begin(), others.end(), overtaken), others.end());
  others.push_back(own);
  return true;
}

namespace {

class Enumeration {
 public:
  Enumeration(const Offer& offer, const Tails& tails, double floor, long most, Watch& watch)
      : offer_(offer), tails_(tails), floor_(floor), left_(most), watch_(watch),
        on_it_(offer.n(), 0) {}

  WorthyLists run() {
    for (int i = 0; i < offer_.n(); ++i) reach(i, offer_.first_s[i], 0.0, 0.0, 1);
    return best_.found(left_ > 0 && !watch_.stopped());
  }

 private:
  void reach(int i, double time_s, double earned, double worth, Memory known) {
    if (left_ <= 0 || earned + tails_.best(i, time_s, known) < floor_) return;
    if (watch_.stops_after(offer_.n() * 8)) left_ = 0;
    --left_;
    earned += offer_.gain(i, time_s);
    worth += offer_.weight[i] * (offer_.left_s - time_s);
    list_.push_back(offer_.tasks[i]);
    on_it_[i] = 1;
    if (earned >= floor_) best_.keep(list_, worth);
    for (int next = 0; next < offer_.n(); ++next) {
      if (on_it_[next]) continue;
      const double then_s = time_s + offer_.leg_s(i, next);
      if (then_s < offer_.latest_s[next])
        reach(next, then_s, earned, worth, offer_.moved(known, i, next, offer_.head_memory()));
    }
    on_it_[i] = 0;
    list_.pop_back();
  }

  const Offer& offer_;
  const Tails& tails_;
  double floor_;
  long left_;
  Watch& watch_;
  std::vector<char> on_it_;
  Route list_;
  BestLists best_;
};

}  // namespace

WorthyLists lists_from(const Offer& offer, const Tails& tails, double floor, long most,
                       Watch& watch) {
  return Enumeration(offer, tails, floor, most, watch).run();
}

}  // namespace peckorder
