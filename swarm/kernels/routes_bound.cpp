#include "routes_bound.hpp"

#include <algorithm>
#include <atomic>
#include <limits>
#include <thread>

namespace peckorder {

namespace {

constexpr double kNever = -std::numeric_limits<double>::infinity();
constexpr double kDown = 1.0 - 1e-12;  // rounding in a quotient must not lengthen a leg
constexpr int kBlock = 8;              // buckets worked on side by side

// Backward dynamic programme over (task, bucket) for one UAV. rest(i, τ): best of what follows
// after completing i in bucket τ; from(i, τ): the same with completing i there counted in.
class PricedList {
 public:
  PricedList(const Instance& instance, const Start& start, int uav,
             const std::vector<int>& open, const std::vector<double>& prices, double bucket_s)
      : instance_(instance), start_(start), uav_(uav), bucket_s_(bucket_s) {
    left_s_ = instance.horizon_s() - start.free_s[uav];
    last_ = left_s_ <= 0.0 ? -1 : static_cast<int>(left_s_ / bucket_s / kDown);
    for (const int task : open)
      if (instance.capable(uav, task)) tasks_.push_back(task);
    for (const int task : tasks_) {
      weight_.push_back(start.survived[uav] * instance.weight(uav, task));
      price_.push_back(prices[task]);
    }
    row_ = static_cast<std::size_t>((last_ / kBlock + 2) * kBlock);
  }

  double solve(std::vector<int>& list) {
    list.clear();
    if (last_ < 0 || tasks_.empty()) return 0.0;
    fill();
    double best = 0.0;
    int next = -1, at = 0;
    for (int l = 0; l < n(); ++l) {
      const double first_s =
          start_.first_m(uav_, tasks_[l]) * instance_.pace(uav_) + instance_.service_s(tasks_[l]);
      const int bucket = buckets(first_s);
      if (bucket <= last_ && from_[l * row_ + bucket] > best) {
        best = from_[l * row_ + bucket];
        next = l;
        at = bucket;
      }
    }
    while (next >= 0) {
      list.push_back(tasks_[next]);
      const int here = next;
      double most = 0.0;
      next = -1;
      int then = at;
      for (int l = 0; l < n(); ++l) {
        const int bucket = at + shift_[static_cast<std::size_t>(here) * n() + l];
        if (l == here || bucket > last_) continue;
        if (from_[l * row_ + bucket] > most) {
          most = from_[l * row_ + bucket];
          next = l;
          then = bucket;
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

  int n() const { return static_cast<int>(tasks_.size()); }

  int buckets(double leg_s) const {
    return static_cast<int>(std::min(leg_s / bucket_s_ * kDown, 1e6));
  }

  void fill() {
    from_.assign(static_cast<std::size_t>(n()) * row_, kNever);
    shift_.resize(static_cast<std::size_t>(n()) * n());
    std::vector<Short> short_legs;
    for (int i = 0; i < n(); ++i) {
      for (int l = 0; l < n(); ++l) {
        // legs are not below one bucket but for rounding
        const int shift = std::max(1, buckets(instance_.leg_s(uav_, tasks_[i], tasks_[l])));
        shift_[static_cast<std::size_t>(i) * n() + l] = shift;
        if (i != l && shift < kBlock) short_legs.push_back({i, l, shift});
      }
    }
    // beyond these buckets completing a task gains nothing, so no list goes there
    std::vector<int> latest(n(), -1);
    std::vector<double> rest(static_cast<std::size_t>(n()) * kBlock);
    for (int begin = last_ / kBlock * kBlock; begin >= 0; begin -= kBlock) {
      for (int i = 0; i < n(); ++i) {
        const int* shift = &shift_[static_cast<std::size_t>(i) * n()];
        double best[kBlock] = {};
        for (int l = 0; l < n(); ++l) {
          if (shift[l] < kBlock || begin + shift[l] > latest[l] || l == i) continue;
          const double* candidate = &from_[l * row_ + begin + shift[l]];
          for (int r = 0; r < kBlock; ++r) best[r] = std::max(best[r], candidate[r]);
        }
        std::copy(best, best + kBlock, &rest[static_cast<std::size_t>(i) * kBlock]);
      }
      for (int r = kBlock - 1; r >= 0; --r) {
        const int bucket = begin + r;
        if (bucket > last_) continue;
        for (const Short& leg : short_legs) {
          double& best = rest[static_cast<std::size_t>(leg.from) * kBlock + r];
          if (bucket + leg.shift <= last_)
            best = std::max(best, from_[leg.to * row_ + bucket + leg.shift]);
        }
        const double left_s = std::max(0.0, left_s_ - bucket * bucket_s_);
        for (int l = 0; l < n(); ++l) {
          const double gain = weight_[l] * left_s - price_[l] +
                              rest[static_cast<std::size_t>(l) * kBlock + r];
          from_[l * row_ + bucket] = gain;
          if (gain > 0.0 && latest[l] < 0) latest[l] = bucket;
        }
      }
    }
  }

  const Instance& instance_;
  const Start& start_;
  int uav_;
  double bucket_s_, left_s_;
  int last_;         // bucket; later is worth nothing
  std::size_t row_;  // buckets per task in memory: -inf after the last one
  std::vector<int> tasks_, shift_;
  std::vector<double> weight_, price_, from_;
};

}  // namespace

double shortest_leg_s(const Instance& instance, const Start& start) {
  double shortest_s = std::numeric_limits<double>::infinity();
  double least_pace = std::numeric_limits<double>::infinity();
  for (int uav = 0; uav < instance.n_uav(); ++uav)
    if (start.active[uav]) least_pace = std::min(least_pace, instance.pace(uav));
  for (int a = 0; a < instance.n_task(); ++a)
    for (int b = 0; b < instance.n_task(); ++b)
      if (a != b)
        shortest_s = std::min(shortest_s, instance.distance_m(a, b) * least_pace +
                                              instance.service_s(b));
  return shortest_s;
}

double priced_lists(const Instance& instance, const Start& start, const std::vector<int>& open,
                    const std::vector<double>& prices, double bucket_s, int threads,
                    std::vector<int>& visits) {
  std::vector<int> uavs;
  for (int uav = 0; uav < instance.n_uav(); ++uav)
    if (start.active[uav]) uavs.push_back(uav);
  std::vector<std::vector<int>> lists(uavs.size());
  std::vector<double> values(uavs.size(), 0.0);
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t k; (k = next.fetch_add(1)) < uavs.size();)
      values[k] = PricedList(instance, start, uavs[k], open, prices, bucket_s).solve(lists[k]);
  };
  std::vector<std::thread> helpers;
  for (int k = 1; k < std::min<int>(threads, static_cast<int>(uavs.size())); ++k)
    helpers.emplace_back(work);
  work();
  for (std::thread& helper : helpers) helper.join();
  visits.assign(instance.n_task(), 0);
  double sum = 0.0;
  for (std::size_t k = 0; k < uavs.size(); ++k) {
    sum += values[k];
    for (const int task : lists[k]) ++visits[task];
  }
  return sum;
}

}  // namespace peckorder
