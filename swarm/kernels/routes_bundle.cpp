#include "routes_bundle.hpp"

#include <algorithm>
#include <cstdint>
#include <functional>
#include <utility>

namespace peckorder {

namespace {
constexpr int kMovesPerVisit = 4;  // of shares, before the next UAV's turn

std::size_t hash_of(const Route& list, double worth) {
  std::size_t hash = std::hash<double>{}(worth);
  for (const int task : list)
    hash ^= static_cast<std::size_t>(task) + 0x9e3779b9U + (hash << 6) + (hash >> 2);
  return hash;
}
}  // namespace

ListBundle::ListBundle(int n_uav, std::vector<double> prices)
    : known_(n_uav),
      at_(n_uav),
      centre_(prices),
      prices_(std::move(prices)),
      visits_(centre_.size(), 0.0),
      difference_(centre_.size(), 0) {
  for (std::vector<Known>& known : known_) known.push_back({{}, 0.0, 1.0});
}

void ListBundle::add(int uav, const Route& list, double worth) {
  std::vector<Known>& known = known_[uav];
  const std::size_t hash = hash_of(list, worth);
  const auto [first, last] = at_[uav].equal_range(hash);
  for (auto at = first; at != last; ++at)
    if (known[at->second].worth == worth && known[at->second].tasks == list) return;
  at_[uav].emplace(hash, known.size());
  known.push_back({list, worth, 0.0});
}

void ListBundle::set_price(int task, double step) {
  prices_[task] = std::max(0.0, centre_[task] - step * (1.0 - visits_[task]));
}

void ListBundle::solve(double step, double tolerance, long sweeps, Watch& watch) {
  for (std::size_t task = 0; task < prices_.size(); ++task) set_price(static_cast<int>(task), step);
  for (long sweep = 0; sweep < sweeps; ++sweep) {
    double most = 0.0;
    for (std::vector<Known>& known : known_) {
      for (int move = 0; move < kMovesPerVisit; ++move) {
        if (watch.stops_after(static_cast<std::int64_t>(known.size()) * 2)) return;
        const double more = improve(known, step);
        if (move == 0) most = std::max(most, more);
        if (more <= tolerance) break;
      }
    }
    if (most <= tolerance) break;
  }
}

double ListBundle::improve(std::vector<Known>& known, double step) {
  std::size_t best = 0, worst = known.size();
  double most = 0.0, least = 0.0;
  for (std::size_t k = 0; k < known.size(); ++k) {
    const double left = known[k].left(prices_);
    if (k == 0 || left > most) {
      most = left;
      best = k;
    }
    if (known[k].share > 0.0 && (worst == known.size() || left < least)) {
      least = left;
      worst = k;
    }
  }
  if (worst == known.size() || !(most > least)) return 0.0;
  for (const int task : known[best].tasks) ++difference_[task];
  for (const int task : known[worst].tasks) --difference_[task];
  double square = 0.0;
  const auto weigh = [&](const Route& tasks) {
    for (const int task : tasks) {
      square += static_cast<double>(difference_[task]) * difference_[task];
      difference_[task] = 0;
    }
  };
  weigh(known[best].tasks);
  weigh(known[worst].tasks);
  double share = known[worst].share;
  if (square > 0.0) share = std::min(share, (most - least) / (step * square));
  known[worst].share = share < known[worst].share ? known[worst].share - share : 0.0;
  known[best].share += share;
  for (const int task : known[worst].tasks) visits_[task] -= share;
  for (const int task : known[best].tasks) visits_[task] += share;
  for (const int task : known[worst].tasks) set_price(task, step);
  for (const int task : known[best].tasks) set_price(task, step);
  return most - least;
}

double ListBundle::value() const {
  double value = 0.0;
  for (const double price : prices_) value += price;
  for (const std::vector<Known>& known : known_) {
    double most = 0.0;
    for (const Known& one : known) most = std::max(most, one.left(prices_));
    value += most;
  }
  return value;
}

std::vector<double> ListBundle::shares() const {
  std::vector<double> shares;
  for (const std::vector<Known>& known : known_)
    for (std::size_t k = 1; k < known.size(); ++k) shares.push_back(known[k].share);
  return shares;
}

}  // namespace peckorder
