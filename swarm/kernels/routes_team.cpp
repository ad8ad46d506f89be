#include "routes_team.hpp"

#include <algorithm>
#include <atomic>
#include <thread>
#include <utility>

#include "routes_local.hpp"

namespace peckorder {

namespace {
constexpr int kFewestLanes = 2, kMostLanes = 8;
constexpr int kUavsPerLane = 12;
constexpr int kUavsToDivide = 10;   // fewer are not divided
constexpr double kHottest = 1.5;    // of the mean delay; about the cost of a clumsy insertion
constexpr int kHeatSteps = 64;
constexpr double kHeatRatio = 0.930572040929699;  // its 64th power is 1/100

// hottest · (1/100)^(1 - heat), by multiplications alone.
double temperature(double hottest, double heat) {
  const double cold = (1.0 - std::min(1.0, std::max(0.0, heat))) * kHeatSteps;
  const int steps = static_cast<int>(cold);
  double factor = 1.0;
  for (int k = 0; k < steps; ++k) factor *= kHeatRatio;
  return hottest * factor * (1.0 - (cold - steps) * (1.0 - kHeatRatio));
}
}  // namespace

TeamSearch::TeamSearch(const Problem& problem, const Start& start, std::vector<Route> lists,
                       const std::vector<int>& tasks, std::uint64_t seed)
    : problem_(problem), start_(start), random_(seed), current_(std::move(lists)) {
  Solution solution(problem, start);
  uavs_ = solution.allowed();
  for (const int uav : uavs_) solution.set_route(uav, current_[uav]);
  insert_missing(solution, tasks);
  current_ = best_ = solution.routes();
  best_value_ = solution.total();
  hottest_ = kHottest * solution.mean_delay();
  divided_ = static_cast<int>(uavs_.size()) >= kUavsToDivide;
  const int lanes = std::min(
      kMostLanes, std::max(kFewestLanes, static_cast<int>(uavs_.size()) / kUavsPerLane));
  lanes_.reserve(lanes);
  for (int lane = 0; lane < lanes; ++lane) {
    lanes_.emplace_back(problem, start, random_.bits());
    if (!divided_) lanes_.back().load(current_, uavs_);
  }
}

void TeamSearch::round(long iterations, double heat, int threads) {
  if (uavs_.empty()) return;
  if (divided_) divide();
  const double now = temperature(hottest_, heat);
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t lane; (lane = next.fetch_add(1)) < lanes_.size();)
      lanes_[lane].run(iterations, now);
  };
  std::vector<std::thread> helpers;
  for (int k = 1; k < std::min<int>(threads, n_lane()); ++k) helpers.emplace_back(work);
  work();
  for (std::thread& helper : helpers) helper.join();
  join();
}

void TeamSearch::polish(Watch& watch) {
  Solution solution(problem_, start_);
  for (const int uav : uavs_) solution.set_route(uav, best_[uav]);
  improve(solution, uavs_, watch);
  current_ = best_ = solution.routes();
  best_value_ = solution.total();
  if (divided_) return;  // each round loads its lanes anew
  for (Search& lane : lanes_) lane.load(current_, uavs_);
}

// As many UAVs to each lane, by the middles of their lists along a random direction.
void TeamSearch::divide() {
  const double east = random_.uniform() - 0.5, north = random_.uniform() - 0.5;
  std::vector<std::pair<double, int>> order;
  for (const int uav : uavs_) {
    double x = 0.0, y = 0.0;
    for (const int task : current_[uav]) {
      x += problem_.place_m(task)[0];
      y += problem_.place_m(task)[1];
    }
    const std::size_t count = current_[uav].size();
    if (count == 0) {
      x = start_.place_m[3 * std::size_t(uav)];
      y = start_.place_m[3 * std::size_t(uav) + 1];
    }
    const double per = 1.0 / static_cast<double>(std::max<std::size_t>(1, count));
    order.emplace_back((east * x + north * y) * per, uav);
  }
  std::sort(order.begin(), order.end());
  std::size_t from = 0;
  for (std::size_t lane = 0; lane < lanes_.size(); ++lane) {
    const std::size_t to = order.size() * (lane + 1) / lanes_.size();
    std::vector<int> part;
    for (; from < to; ++from) part.push_back(order[from].second);
    std::sort(part.begin(), part.end());
    lanes_[lane].load(current_, part);
  }
}

void TeamSearch::join() {
  double value = 0.0;
  if (!divided_) {
    for (const Search& lane : lanes_) {
      if (!(lane.best_value() > best_value_)) continue;
      best_value_ = lane.best_value();
      for (const int uav : uavs_) best_[uav] = lane.best_route(uav);
    }
    return;
  }
  for (const Search& lane : lanes_) value += lane.best_value();
  const bool better = value > best_value_;
  if (better) best_value_ = value;
  for (const Search& lane : lanes_) {
    for (const int uav : lane.uavs()) {
      if (better) best_[uav] = lane.best_route(uav);
      current_[uav] = lane.current().route(uav);
    }
  }
}

}  // namespace peckorder
