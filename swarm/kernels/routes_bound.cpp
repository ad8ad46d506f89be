#include "routes_bound.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <queue>
#include <utility>

#include "parallel.hpp"

namespace peckorder {

namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr double kNever = -kInfinite;
constexpr double kDown = 1.0 - 1e-12;  // rounding in a quotient must not lengthen a leg
constexpr int kBlock = 8;              // buckets worked on side by side
constexpr int kLegsPerStep = 4;        // of a Watch
constexpr double kNear = 1e-5;         // of a value: as good as reached by the search

// One UAV's tasks, what they are worth to it and when it can complete them, times counted from when
// it is free.
struct TimedOffer {
  double left_s;                 // until the horizon
  std::vector<int> tasks;
  std::vector<double> weight, survival, price, first_s, leg_s, earliest_s, latest_s;

  TimedOffer(const Problem& problem, const Start& start, int uav, const RelaxedPricing& pricing)
      : left_s(problem.horizon_s() - start.free_s[uav]) {
    const Timetable* table = pricing.timetable;
    const double free_s = start.free_s[uav];
    for (const int task : pricing.open)
      if (problem.capable(uav, task)) tasks.push_back(task);
    leg_s.reserve(tasks.size() * tasks.size());
    for (const int task : tasks) {
      weight.push_back(start.survived[uav] * problem.weight(uav, task));
      survival.push_back(pricing.expansions > 0 ? problem.survival(uav, task) : 1.0);
      price.push_back(pricing.prices[task]);
      first_s.push_back(table ? table->first_s[table->at(uav, task)]
                              : start.travel_s(uav, task) + problem.service_s(task));
      earliest_s.push_back(table ? table->earliest_s[table->at(uav, task)] - free_s : 0.0);
      latest_s.push_back(table ? table->latest_s[table->at(uav, task)] - free_s : kInfinite);
      for (const int to : tasks)
        leg_s.push_back(table ? table->leg_s[table->at(uav, task) * table->n_task + to]
                              : problem.leg_s(uav, task, to));
    }
  }

  int n() const { return static_cast<int>(tasks.size()); }

  double leg(int from, int to) const {
    return leg_s[static_cast<std::size_t>(from) * n() + to];
  }

  // What completing task `l` at that time gains.
  double gain(int l, double time_s, double survived = 1.0) const {
    return survived * weight[l] * std::max(0.0, left_s - time_s) - price[l];
  }

  // Nothing that follows is worth anything.
  bool ends(int l) const { return survival[l] == 0.0; }
};

// Backward dynamic programme over (task, bucket). rest(i, τ): best of what follows after
// completing i in bucket τ; from(i, τ): the same with completing i there counted in, or as soon
// afterwards as it may be.
class RelaxedLists {
 public:
  // Of no use once the watch has stopped it.
  RelaxedLists(const TimedOffer& offer, double bucket_s, Watch& watch)
      : offer_(offer), n_(offer.n()), bucket_s_(bucket_s) {
    double last_s = n_ == 0 ? -1.0 : *std::max_element(offer.latest_s.begin(), offer.latest_s.end());
    last_s = std::min(last_s, offer.left_s);
    last_ = offer.left_s <= 0.0 || last_s < 0.0 ? -1 : upwards(last_s);
    row_ = static_cast<std::size_t>((last_ / kBlock + 2) * kBlock);
    if (last_ >= 0) fill(watch);
  }

  // Beyond it nothing can be completed; -1 if nothing can at all.
  int last() const { return last_; }

  int bucket(double time_s) const {
    return static_cast<int>(std::min(std::max(0.0, time_s) / bucket_s_ * kDown, 1e6));
  }

  double rest(int i, int bucket) const { return rest_[i * row_ + bucket]; }

  double best(std::vector<int>& list) const {
    double best = 0.0;
    int next = -1, at = 0;
    for (int l = 0; l < n_; ++l) {
      const int bucket = this->bucket(offer_.first_s[l]);
      if (bucket <= last_ && from_[l * row_ + bucket] > best) {
        best = from_[l * row_ + bucket];
        next = l;
        at = bucket;
      }
    }
    while (next >= 0) {
      list.push_back(offer_.tasks[next]);
      const int here = next;
      at = std::max(at, opens_[here]);
      double most = 0.0;
      next = -1;
      int then = at;
      for (int l = 0; l < n_ && !offer_.ends(here); ++l) {
        const int shift = shift_[static_cast<std::size_t>(here) * n_ + l];
        if (l == here || shift == 0 || at + shift > last_) continue;
        if (from_[l * row_ + at + shift] > most) {
          most = from_[l * row_ + at + shift];
          next = l;
          then = at + shift;
        }
      }
      at = then;
    }
    return best;
  }

 private:
  struct Short {
    int from, to, shift;
  };

  int upwards(double time_s) const {
    return static_cast<int>(std::min(time_s / bucket_s_ / kDown, 1e6));
  }

  void fill(Watch& watch) {
    opens_.resize(n_);
    closes_.resize(n_);
    for (int i = 0; i < n_; ++i) {
      opens_[i] = bucket(offer_.earliest_s[i]);
      closes_[i] = offer_.latest_s[i] < offer_.earliest_s[i] || offer_.latest_s[i] < 0.0
                       ? -1
                       : std::min(last_, upwards(std::min(offer_.latest_s[i], offer_.left_s)));
    }
    from_.assign(static_cast<std::size_t>(n_) * row_, kNever);
    rest_.assign(static_cast<std::size_t>(n_) * row_, 0.0);
    shift_.resize(static_cast<std::size_t>(n_) * n_);
    std::vector<Short> short_legs;
    for (int i = 0; i < n_; ++i) {
      for (int l = 0; l < n_; ++l) {
        const double leg_s = offer_.leg(i, l);
        // a leg of one bucket may come to less by rounding
        const int shift = leg_s < bucket_s_ ? 0 : std::max(1, bucket(leg_s));
        shift_[static_cast<std::size_t>(i) * n_ + l] = shift;
        if (i != l && shift > 0 && shift < kBlock) short_legs.push_back({i, l, shift});
      }
    }
    const std::vector<std::vector<int>> knots = this->knots();
    // beyond these buckets completing a task gains nothing, so no list goes there
    std::vector<int> latest(n_, -1);
    for (int begin = last_ / kBlock * kBlock; begin >= 0; begin -= kBlock) {
      for (int i = 0; i < n_; ++i) {
        if (offer_.ends(i)) continue;
        if (watch.stops_after(n_ / kLegsPerStep + 1)) return;
        const int* shift = &shift_[static_cast<std::size_t>(i) * n_];
        double best[kBlock] = {};
        for (int l = 0; l < n_; ++l) {
          if (shift[l] < kBlock || begin + shift[l] > latest[l] || l == i) continue;
          const double* candidate = &from_[l * row_ + begin + shift[l]];
          for (int r = 0; r < kBlock; ++r) best[r] = std::max(best[r], candidate[r]);
        }
        std::copy(best, best + kBlock, &rest_[i * row_ + begin]);
      }
      for (int r = kBlock - 1; r >= 0; --r) {
        const int bucket = begin + r;
        if (bucket > last_) continue;
        if (watch.stops_after(static_cast<std::int64_t>(short_legs.size()) / kLegsPerStep + 1)) return;
        for (const Short& leg : short_legs) {
          if (bucket + leg.shift > last_ || offer_.ends(leg.from)) continue;
          double& best = rest_[leg.from * row_ + bucket];
          best = std::max(best, from_[leg.to * row_ + bucket + leg.shift]);
        }
        for (const std::vector<int>& knot : knots) untie(knot, bucket);
        for (int l = 0; l < n_; ++l) {
          double& from = from_[l * row_ + bucket];
          if (bucket < opens_[l])
            from = from_[l * row_ + bucket + 1];
          else if (bucket <= closes_[l])
            from = offer_.gain(l, bucket * bucket_s_) + rest_[l * row_ + bucket];
          if (from > 0.0 && latest[l] < 0) latest[l] = bucket;
        }
      }
    }
  }

  // Tasks joined by legs below one bucket, where there are such legs.
  std::vector<std::vector<int>> knots() const {
    std::vector<int> head(n_);
    std::iota(head.begin(), head.end(), 0);
    for (int i = 0; i < n_; ++i)
      for (int l = 0; l < n_; ++l)
        if (shift_[static_cast<std::size_t>(i) * n_ + l] == 0 && head[i] != head[l])
          std::replace(head.begin(), head.end(), int(head[l]), int(head[i]));
    std::vector<std::vector<int>> members(n_), knots;
    for (int i = 0; i < n_; ++i) members[head[i]].push_back(i);
    for (std::vector<int>& knot : members)
      if (knot.size() > 1) knots.push_back(std::move(knot));
    return knots;
  }

  // Within one bucket a real list completes each task of a knot once at most; then it leaves.
  void untie(const std::vector<int>& knot, int bucket) {
    double all = 0.0, leave = 0.0;
    const auto own = [&](int k) {
      if (bucket > closes_[k]) return 0.0;
      return std::max(0.0, offer_.gain(k, std::max(bucket, opens_[k]) * bucket_s_));
    };
    for (const int k : knot) {
      all += own(k);
      leave = std::max(leave, rest_[k * row_ + bucket]);
    }
    for (const int k : knot)
      if (!offer_.ends(k)) rest_[k * row_ + bucket] = all - own(k) + leave;
  }

  const TimedOffer& offer_;
  int n_;
  double bucket_s_;
  int last_;
  std::size_t row_;  // buckets per task in memory: -inf after the last one
  std::vector<int> shift_, opens_, closes_;
  std::vector<double> from_, rest_;
};

// Best-first among real lists. Whatever follows a beginning adds at most the relaxed rest, as
// survival only lowers it; so the greatest such sum of all beginnings that are not yet continued
// bounds every list not yet seen.
class RealLists {
 public:
  RealLists(const TimedOffer& offer, const RelaxedLists& relaxed) : offer_(offer), relaxed_(relaxed) {}

  double best(long expansions, std::vector<int>& list, Watch& watch) {
    std::vector<char> on_it(offer_.n(), 0);
    const auto mark = [&](int at, char is) {
      for (int k = at; k >= 0; k = nodes_[k].before) on_it[nodes_[k].task] = is;
    };
    for (int l = 0; l < offer_.n(); ++l) reach({-1, l, offer_.first_s[l], 1.0, 0.0});
    double bound = value_;
    for (long made = 0; !open_.empty(); ++made) {
      const auto [most, at] = open_.top();
      bound = std::max(value_, most);
      if (most <= value_ * (1.0 + kNear)) break;
      if (made == expansions) {
        relaxed_.best(list);
        return bound;
      }
      open_.pop();
      if (watch.stops_after(offer_.n())) return 0.0;
      const Node node = nodes_[at];
      const double survived = node.survived * offer_.survival[node.task];
      mark(at, 1);
      for (int l = 0; l < offer_.n(); ++l)
        if (!on_it[l])
          reach({at, l, node.time_s + offer_.leg(node.task, l), survived, node.value});
      mark(at, 0);
      bound = value_;
    }
    for (int k = best_; k >= 0; k = nodes_[k].before) list.push_back(offer_.tasks[nodes_[k].task]);
    return bound;
  }

 private:
  struct Node {
    int before, task;
    double time_s;    // of completing the task
    double survived;  // until then
    double value;     // of all so far
  };

  // `node` as it is on arrival, without the task's own value.
  void reach(Node node) {
    const int l = node.task;
    node.time_s = std::max(node.time_s, offer_.earliest_s[l]);
    if (node.time_s > offer_.latest_s[l] || node.time_s >= offer_.left_s) return;
    node.value += offer_.gain(l, node.time_s, node.survived);
    const int bucket = relaxed_.bucket(node.time_s);
    const bool over = offer_.ends(l) || bucket > relaxed_.last();
    const double most = over ? node.value : node.value + relaxed_.rest(l, bucket);
    if (most <= value_) return;
    nodes_.push_back(node);
    const int at = static_cast<int>(nodes_.size()) - 1;
    if (node.value > value_) {
      value_ = node.value;
      best_ = at;
    }
    if (most > node.value) open_.emplace(most, at);
  }

  const TimedOffer& offer_;
  const RelaxedLists& relaxed_;
  std::vector<Node> nodes_;
  std::priority_queue<std::pair<double, int>> open_;
  double value_ = 0.0;  // of the best list seen
  int best_ = -1;       // its last task
};

// All real lists that earn at least `floor`, depth first; gives up after `most` beginnings.
class WorthyRealLists {
 public:
  WorthyRealLists(const TimedOffer& offer, const RelaxedLists& relaxed, double floor, long most,
                  Watch& watch)
      : offer_(offer), relaxed_(relaxed), floor_(floor), left_(most), watch_(watch),
        on_it_(offer.n(), 0) {}

  WorthyLists run() {
    for (int l = 0; l < offer_.n(); ++l) reach(l, offer_.first_s[l], 1.0, 0.0, 0.0);
    return best_.found(left_ > 0 && !watch_.stopped());
  }

 private:
  // The list so far, with `l` next, arrived at at that time; `earned` and `worth` without `l`.
  void reach(int l, double time_s, double survived, double earned, double worth) {
    time_s = std::max(time_s, offer_.earliest_s[l]);
    if (left_ <= 0 || time_s > offer_.latest_s[l] || time_s >= offer_.left_s) return;
    earned += offer_.gain(l, time_s, survived);
    const int bucket = relaxed_.bucket(time_s);
    const bool over = offer_.ends(l) || bucket > relaxed_.last();
    if (earned + (over ? 0.0 : relaxed_.rest(l, bucket)) < floor_) return;
    if (watch_.stops_after(offer_.n())) left_ = 0;
    --left_;
    worth += survived * offer_.weight[l] * (offer_.left_s - time_s);
    survived *= offer_.survival[l];
    list_.push_back(offer_.tasks[l]);
    on_it_[l] = 1;
    if (earned >= floor_) best_.keep(list_, worth);
    for (int next = 0; next < offer_.n() && !over; ++next)
      if (!on_it_[next]) reach(next, time_s + offer_.leg(l, next), survived, earned, worth);
    on_it_[l] = 0;
    list_.pop_back();
  }

  const TimedOffer& offer_;
  const RelaxedLists& relaxed_;
  double floor_;
  long left_;
  Watch& watch_;
  std::vector<char> on_it_;
  Route list_;
  BestLists best_;
};

PricedList relaxed_list(const Problem& problem, const Start& start, int uav,
                        const RelaxedPricing& pricing, Watch& watch) {
  PricedList found;
  const TimedOffer offer(problem, start, uav, pricing);
  watch.stops_after(static_cast<std::int64_t>(offer.n()) * offer.n() / 2);
  const RelaxedLists relaxed(offer, pricing.bucket_s, watch);
  if (relaxed.last() < 0 || watch.stopped()) return found;
  found.bound = pricing.expansions == 0
                    ? relaxed.best(found.list)
                    : RealLists(offer, relaxed).best(pricing.expansions, found.list, watch);
  found.worth = found.bound;
  for (const int task : found.list) found.worth += pricing.prices[task];
  return found;
}

WorthyLists worthy_timed_list(const Problem& problem, const Start& start, int uav,
                              const RelaxedPricing& pricing, double floor, Watch& watch) {
  const TimedOffer offer(problem, start, uav, pricing);
  const RelaxedLists relaxed(offer, pricing.bucket_s, watch);
  if (relaxed.last() < 0 || watch.stopped()) return {};
  return WorthyRealLists(offer, relaxed, floor, pricing.expansions, watch).run();
}

}  // namespace

std::vector<PricedList> relaxed_lists(const Problem& problem, const Start& start,
                                      const RelaxedPricing& pricing, Watch& watch) {
  std::vector<PricedList> found(start.active.size());
  parallel_for(found.size(), pricing.threads, 1, [&] {
    return [&](std::size_t uav) {
      if (start.active[uav] && !watch.stopped())
        found[uav] = relaxed_list(problem, start, static_cast<int>(uav), pricing, watch);
    };
  });
  return found;
}

std::vector<WorthyLists> worthy_timed_lists(const Problem& problem, const Start& start,
                                            const RelaxedPricing& pricing,
                                            const std::vector<double>& most, double slack,
                                            Watch& watch) {
  std::vector<WorthyLists> found(start.active.size());
  parallel_for(found.size(), pricing.threads, 1, [&] {
    return [&](std::size_t uav) {
      if (start.active[uav] && !watch.stopped())
        found[uav] = worthy_timed_list(problem, start, static_cast<int>(uav), pricing,
                                       most[uav] - slack, watch);
    };
  });
  return found;
}

}  // namespace peckorder
