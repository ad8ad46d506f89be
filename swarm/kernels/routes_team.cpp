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
constexpr int kUavsToDivide = 10;  // fewer are not divided
constexpr double kHottest = 1.5;  // of the mean delay; about the cost of a clumsy insertion
constexpr double kHottestGranular = 3.0;  // measured on published instances
constexpr int kShortList = 80;     // tasks a UAV; up to some 60, Search does as well or better
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
                       const std::vector<int>& tasks, std::uint64_t seed, const GivenTimes* given)
    : problem_(problem),
      start_(start),
      random_(seed),
      given_(given != nullptr),
      current_(std::move(lists)) {
  Solution solution(problem, start);
  uavs_ = solution.allowed();
  const double length = static_cast<double>(tasks.size()) / std::max<std::size_t>(1, uavs_.size());
  if (given_ || (problem.certain() && length > kShortList)) terms_.emplace(problem, start, given);
  most_iterations_ = static_cast<long>(terms_ ? 400.0 / std::max(1.0, length / 100.0)
                                              : 1000.0 / std::max(1.0, length / 100.0));
  if (given_) {
    GranularSearch first(*terms_, random_.bits());
    first.load(current_, uavs_);
    first.settle(tasks);
    for (const int uav : uavs_) current_[uav] = first.current_route(uav);
    best_value_ = first.best_value();
    hottest_ = kHottestGranular * first.mean_delay();
  } else {
    for (const int uav : uavs_) solution.set_route(uav, current_[uav]);
    insert_missing(solution, tasks);
    current_ = solution.routes();
    best_value_ = solution.total();
    hottest_ = (terms_ ? kHottestGranular : kHottest) * solution.mean_delay();
  }
  best_ = current_;
  divided_ = !given_ && static_cast<int>(uavs_.size()) >= kUavsToDivide;
  const int lanes = std::min(
      kMostLanes, std::max(kFewestLanes, static_cast<int>(uavs_.size()) / kUavsPerLane));
  lanes_.reserve(lanes);
  for (int lane = 0; lane < lanes; ++lane) {
    const std::uint64_t bits = random_.bits();
    if (terms_)
      lanes_.push_back(std::make_unique<GranularSearch>(*terms_, bits));
    else
      lanes_.push_back(std::make_unique<Search>(problem, start, bits));
    if (!divided_) lanes_.back()->load(current_, uavs_);
  }
}

void TeamSearch::round(long iterations, double heat, int threads, Watch& watch) {
  if (uavs_.empty()) return;
  if (divided_) divide();
  const double now = temperature(hottest_, heat);
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t lane; (lane = next.fetch_add(1)) < lanes_.size();)
      lanes_[lane]->run(iterations, now, watch);
  };
  std::vector<std::thread> helpers;
  for (int k = 1; k < std::min<int>(threads, n_lane()); ++k) helpers.emplace_back(work);
  work();
  for (std::thread& helper : helpers) helper.join();
  join();
}

void TeamSearch::polish(Watch& watch) {
  if (given_) return;  // lanes have descended themselves
  Solution solution(problem_, start_);
  for (const int uav : uavs_) solution.set_route(uav, best_[uav]);
  improve(solution, uavs_, watch);
  current_ = best_ = solution.routes();
  best_value_ = solution.total();
  if (divided_) return;  // each round loads its lanes anew
  for (auto& lane : lanes_) lane->load(current_, uavs_);
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
    lanes_[lane]->load(current_, part);
  }
}

void TeamSearch::join() {
  double value = 0.0;
  if (!divided_) {
    for (const auto& lane : lanes_) {
      if (!(lane->best_value() > best_value_)) continue;
      best_value_ = lane->best_value();
      for (const int uav : uavs_) best_[uav] = lane->best_route(uav);
    }
    return;
  }
  for (const auto& lane : lanes_) value += lane->best_value();
  const bool better = value > best_value_;
  if (better) best_value_ = value;
  for (const auto& lane : lanes_) {
    for (const int uav : lane->uavs()) {
      if (better) best_[uav] = lane->best_route(uav);
      current_[uav] = lane->current_route(uav);
    }
  }
}

}  // namespace peckorder
