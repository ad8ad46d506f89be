#include "routes_offer.hpp"

#include <algorithm>

namespace peckorder {

namespace {

constexpr int kMostTasks = 2000;  // looked at: 4 MB of places, and at most 64 MB of arcs
constexpr int kMostMemory = 32;
constexpr int kTailMemory = 4;
// Tasks between which a UAV can go to and fro so soon are told apart even in tails.
constexpr double kSoonFrac = 0.02;  // of the time until the horizon

}  // namespace

Offer::Offer(const Problem& problem, const Start& start, int uav, const ListPricing& pricing,
             Watch& watch)
    : left_s(problem.horizon_s() - start.free_s[uav]),
      problem_(problem),
      prices_(pricing.prices),
      uav_(uav),
      near_(pricing.near) {
  choose(start, pricing);
  look_around();
  if (!watch.stops_after(static_cast<std::int64_t>(n()) * 100)) join(watch);
}

void Offer::choose(const Start& start, const ListPricing& pricing) {
  std::vector<std::pair<double, int>> worthy;  // with what each earns at most, negative
  for (const int task : pricing.open) {
    if (!problem_.capable(uav_, task)) continue;
    const double first_s = start.travel_s(uav_, task) + problem_.service_s(task);
    const double weight = start.survived[uav_] * problem_.weight(uav_, task);
    const double most = weight * (left_s - first_s) - pricing.prices[task] + pricing.slack;
    if (weight > 0.0 && most > 0.0) worthy.emplace_back(-most, task);
  }
  if (worthy.size() > kMostTasks) {
    std::sort(worthy.begin(), worthy.end());
    for (std::size_t k = kMostTasks; k < worthy.size(); ++k) beside -= worthy[k].first;
    worthy.resize(kMostTasks);
  }
  for (const auto& [most, task] : worthy) tasks.push_back(task);
  std::sort(tasks.begin(), tasks.end());
  for (const int task : tasks) {
    weight.push_back(start.survived[uav_] * problem_.weight(uav_, task));
    price.push_back(pricing.prices[task]);
    first_s.push_back(start.travel_s(uav_, task) + problem_.service_s(task));
    latest_s.push_back(left_s - (price.back() - pricing.slack) / weight.back());
  }
}

void Offer::look_around() {
  const int n = this->n();
  memory_ = std::min({n, kMostMemory, 1 + problem_.n_near()});
  std::vector<int> index(problem_.n_task(), -1);
  for (int i = 0; i < n; ++i) index[tasks[i]] = i;
  around_.assign(static_cast<std::size_t>(n) * memory_, -1);
  place_.assign(static_cast<std::size_t>(n) * n, 0);
  for (int i = 0; i < n; ++i) {
    int* around = &around_[static_cast<std::size_t>(i) * memory_];
    std::uint8_t* place = &place_[static_cast<std::size_t>(i) * n];
    int count = 0, soon = 0;
    const auto take = [&](int k) {
      around[count++] = k;
      place[k] = static_cast<std::uint8_t>(count);
    };
    take(i);
    const std::int32_t* near = problem_.near(tasks[i]);
    for (int k = 0; k < problem_.n_near() && count < memory_; ++k) {
      const int other = index[near[k]];
      if (other < 0) continue;
      take(other);
      if (leg_s(i, other) + leg_s(other, i) <= kSoonFrac * left_s) soon = count;
    }
    tail_memory_.push_back(std::min(count, std::max(kTailMemory, soon)));
  }
}

void Offer::join(Watch& watch) {
  const int n = this->n();
  std::vector<std::vector<Arc>> into(n);
  for (int from = 0; from < n; ++from) {
    for_next(from, [&](int to) {
      const double reach_s = first_s[from] + leg_s(from, to);
      if (reach_s < latest_s[to]) into[to].push_back({reach_s, from});
    });
    if (watch.stops_after(near_ == 0 ? n : near_)) return;
  }
  arcs_end_.push_back(0);
  for (std::vector<Arc>& arcs : into) {
    std::sort(arcs.begin(), arcs.end(), [](const Arc& a, const Arc& b) {
      return a.reach_s < b.reach_s || (a.reach_s == b.reach_s && a.from < b.from);
    });
    arcs_.insert(arcs_.end(), arcs.begin(), arcs.end());
    arcs_end_.push_back(arcs_.size());
    if (watch.stops_after(static_cast<std::int64_t>(arcs.size()))) return;
  }
}

Memory Offer::moved(Memory known, int from, int to, int memory) const {
  Memory kept = 1;
  const int* around = &around_[static_cast<std::size_t>(from) * memory_];
  const std::uint8_t* place = &place_[static_cast<std::size_t>(to) * n()];
  for (int k = 0; known != 0; ++k, known >>= 1) {
    if ((known & 1) == 0) continue;
    const int there = place[around[k]];
    if (there > 0 && there <= memory) kept |= Memory{1} << (there - 1);
  }
  return kept;
}

}  // namespace peckorder
