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
constexpr int kShortList = 80;     // tasks a UAV; up to some 60, Search does as well or better
constexpr std::size_t kManyTasks = 2000;
constexpr double kMostBehind = 3.0;  // temperatures; measured, as Annealing below
constexpr int kHeatSteps = 64;
constexpr double kTo100th = 0.930572040929699;  // its 64th power is 1/100
constexpr double kTo500th = 0.9074623044174637;   // and of this one 1/500

// Measured: the first on published instances, the others on random missions. Lists to begin with
// are good ones, which heat only spoils; lists that were just put together gain by much of it.
constexpr Annealing kLong{3.0, kTo100th, 200.0, 0.0};
constexpr Annealing kBegun{1.5, kTo100th, 1600.0, 15.0};
constexpr Annealing kAnew{5.0, kTo500th, 800.0, 10.0};
constexpr Annealing kManyAnew{12.0, kTo100th, 0.0, 10.0};

// hottest · ratio^(64 · (1 - heat)), by multiplications alone.
double temperature(double hottest, double heat, double ratio) {
  const double cold = (1.0 - std::min(1.0, std::max(0.0, heat))) * kHeatSteps;
  const int steps = static_cast<int>(cold);
  double factor = 1.0;
  for (int k = 0; k < steps; ++k) factor *= ratio;
  return hottest * factor * (1.0 - (cold - steps) * (1.0 - ratio));
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
  const bool begun =
      std::any_of(uavs_.begin(), uavs_.end(), [this](int uav) { return !current_[uav].empty(); });
  annealing_ = terms_                         ? kLong
               : begun                        ? kBegun
               : tasks.size() > kManyTasks    ? kManyAnew
                                              : kAnew;
  most_iterations_ = static_cast<long>(400.0 / std::max(1.0, length / 100.0));
  if (given_) {
    GranularSearch first(*terms_, random_.bits());
    first.load(current_, uavs_);
    first.settle(tasks);
    for (const int uav : uavs_) current_[uav] = first.current_route(uav);
    best_value_ = first.best_value();
    hottest_ = annealing_.hottest * first.mean_delay();
  } else {
    for (const int uav : uavs_) solution.set_route(uav, current_[uav]);
    insert_missing(solution, tasks);
    current_ = solution.routes();
    best_value_ = solution.total();
    hottest_ = annealing_.hottest * solution.mean_delay();
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
      lanes_.push_back(std::make_unique<Search>(problem, start, bits, annealing_.torn));
    if (!divided_) lanes_.back()->load(current_, uavs_);
  }
}

void TeamSearch::round(long iterations, double heat, int threads, Watch& watch) {
  if (uavs_.empty()) return;
  if (divided_) divide();
  const double now = temperature(hottest_, heat, annealing_.ratio);
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t lane; (lane = next.fetch_add(1)) < lanes_.size();)
      lanes_[lane]->run(iterations, now, watch);
  };
  std::vector<std::thread> helpers;
  for (int k = 1; k < std::min<int>(threads, n_lane()); ++k) helpers.emplace_back(work);
  work();
  for (std::thread& helper : helpers) helper.join();
  join(now);
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

// As many UAVs to each lane, those near each other by the middles of their lists: halves along a
// random direction, their halves across it, and so on.
void TeamSearch::divide() {
  std::vector<Middle> middles;
  for (const int uav : uavs_) {
    const double* start_m = &start_.place_m[3 * std::size_t(uav)];
    Middle middle{start_m[0], start_m[1], uav};
    const Route& route = current_[uav];
    if (!route.empty()) {
      middle.x_m = middle.y_m = 0.0;
      for (const int task : route) {
        middle.x_m += problem_.place_m(task)[0] / static_cast<double>(route.size());
        middle.y_m += problem_.place_m(task)[1] / static_cast<double>(route.size());
      }
    }
    middles.push_back(middle);
  }
  const double east = random_.uniform() - 0.5, north = random_.uniform() - 0.5;
  divide(middles.data(), middles.data() + middles.size(), 0, n_lane(), east, north);
}

void TeamSearch::divide(Middle* from, Middle* to, int lane, int lanes, double east, double north) {
  if (lanes == 1) {
    std::vector<int> part;
    for (const Middle* middle = from; middle != to; ++middle) part.push_back(middle->uav);
    std::sort(part.begin(), part.end());
    lanes_[lane]->load(current_, part);
    return;
  }
  std::sort(from, to, [east, north](const Middle& a, const Middle& b) {
    const double at_a = east * a.x_m + north * a.y_m, at_b = east * b.x_m + north * b.y_m;
    return at_a < at_b || (at_a == at_b && a.uav < b.uav);
  });
  const int half = lanes / 2;
  Middle* const middle = from + (to - from) * half / lanes;
  divide(from, middle, lane, half, -north, east);
  divide(middle, to, lane + half, lanes - half, -north, east);
}

// Lanes of one long list that are further behind than heat explains begin anew from the best. Of
// several lists, two different searches are worth more.
void TeamSearch::join(double temperature) {
  if (!divided_) {
    for (const auto& lane : lanes_) {
      if (!(lane->best_value() > best_value_)) continue;
      best_value_ = lane->best_value();
      for (const int uav : uavs_) best_[uav] = lane->best_route(uav);
    }
    if (!terms_ || uavs_.size() > 1) return;
    for (const auto& lane : lanes_)
      if (best_value_ - lane->best_value() > kMostBehind * temperature) lane->load(best_, uavs_);
    return;
  }
  double value = 0.0;
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
