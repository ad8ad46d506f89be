#include "routes_search.hpp"

#include <algorithm>
#include <limits>

namespace peckorder {

namespace {
constexpr double kLongestString = 10.0;
constexpr double kSplitShare = 0.5;
constexpr double kSplitDepth = 0.01;
constexpr int kSteps = 1000;  // of a watch, for an iteration
constexpr double kMeanToBlink = 99.5;  // places between two that are overlooked; 1 %
}  // namespace

std::vector<int> missing(const Solution& solution, const std::vector<int>& tasks) {
  const Problem& problem = solution.problem();
  std::vector<std::pair<double, int>> order;
  for (const int task : tasks) {
    if (solution.uav_of(task) >= 0) continue;
    double most = -1.0;
    for (const int uav : solution.allowed())
      if (problem.capable(uav, task)) most = std::max(most, problem.weight(uav, task));
    if (most >= 0.0) order.emplace_back(-most, task);
  }
  std::sort(order.begin(), order.end());
  std::vector<int> found;
  for (const auto& [key, task] : order) found.push_back(task);
  return found;
}

void insert_missing(Solution& solution, const std::vector<int>& tasks) {
  for (const int task : missing(solution, tasks)) {
    const Insertion best = best_insertion(solution, task);
    if (best.uav >= 0) solution.insert(best.uav, best.place, task);
  }
}

Search::Search(const Problem& problem, const Start& start, std::uint64_t seed, double mean_torn)
    : current_(problem, start),
      random_(seed),
      mean_torn_(mean_torn),
      versions_(problem.n_uav(), 0),
      best_(problem.n_uav()),
      is_unsaved_(problem.n_uav(), 0),
      is_touched_(problem.n_uav(), 0),
      copies_(problem.n_uav()) {}

void Search::load(const std::vector<Route>& routes, const std::vector<int>& uavs) {
  current_.restrict_to(uavs);
  tasks_.clear();
  for (const int uav : unsaved_) is_unsaved_[uav] = 0;
  unsaved_.clear();
  for (const int uav : uavs) tasks_.insert(tasks_.end(), routes[uav].begin(), routes[uav].end());
  current_.gather(tasks_);
  for (const int uav : uavs) {
    current_.set_route(uav, routes[uav]);
    best_[uav] = routes[uav];
  }
  known_.assign(tasks_.size() * uavs.size(), Known{0.0, 0, 0});
  for (const int uav : uavs) versions_[uav] = ++last_version_;
  gains_.resize(tasks_.size() + 1);
  std::sort(tasks_.begin(), tasks_.end());
  best_value_ = current_.total();
}

void Search::keep_copy(int uav) {
  if (is_touched_[uav]) return;
  is_touched_[uav] = 1;
  current_.copy(uav, copies_[touched_.size()]);
  touched_.push_back(uav);
  value_before_ += current_.route_value(uav);
}

// One place in a hundred is overlooked, independently of each other: gaps between them are drawn.
int Search::places_to_blink() {
  return 1 + static_cast<int>(kMeanToBlink * random_.exponential());
}

Insertion Search::most_gained(int uav) const {
  const int size = static_cast<int>(current_.route(uav).size());
  double most = gains_[0];
  for (int place = 1; place <= size; ++place) most = std::max(most, gains_[place]);
  int place = 0;
  while (place < size && gains_[place] != most) ++place;
  return {uav, place, most};
}

// Of one list; lists that have changed in this iteration may change back.
Insertion Search::best_place(int uav, int task) {
  const std::size_t row = static_cast<std::size_t>(current_.row(task)) * uavs().size();
  Known& known = known_[row + current_.column(uav)];
  if (!is_touched_[uav] && known.version == versions_[uav]) return {uav, known.place, known.gain};
  current_.insertion_gains(uav, task, gains_.data());
  const Insertion best = most_gained(uav);
  if (!is_touched_[uav]) known = {best.gain, best.place, versions_[uav]};
  return best;
}

// `best` of its list, or the next best if that place is overlooked.
Insertion Search::best_unblinked(const Insertion& best, int task) {
  const int places = static_cast<int>(current_.route(best.uav).size()) + 1;
  if (until_blink_ > places) {
    until_blink_ -= places;
    return best;
  }
  overlooked_.clear();
  bool sees_best = true;
  for (; until_blink_ <= places; until_blink_ += places_to_blink()) {
    overlooked_.push_back(until_blink_ - 1);
    sees_best = sees_best && until_blink_ - 1 != best.place;
  }
  until_blink_ -= places;
  if (sees_best) return best;
  current_.insertion_gains(best.uav, task, gains_.data());
  for (const int place : overlooked_) gains_[place] = -std::numeric_limits<double>::infinity();
  return most_gained(best.uav);
}

Insertion Search::best_insertion(int task, bool may_blink) {
  Insertion best;
  for (const int uav : uavs()) {
    if (!current_.capable(uav, task)) continue;
    Insertion found = best_place(uav, task);
    if (may_blink) found = best_unblinked(found, task);
    if (found.gain > best.gain) best = found;
  }
  return best;
}

void Search::ruin() {
  const int mean_length = std::max(1, static_cast<int>(tasks_.size() / uavs().size()));
  const double longest = std::min(kLongestString, static_cast<double>(mean_length));
  const double most_strings = 4.0 * mean_torn_ / (1.0 + longest) - 1.0;
  const int strings = static_cast<int>(random_.uniform() * most_strings + 1.0);
  const int seed = tasks_[random_.below(static_cast<int>(tasks_.size()))];
  const Problem& problem = current_.problem();
  torn_.clear();
  tear(seed, longest);
  const std::int32_t* near = problem.near(seed);
  for (int k = 0; k < problem.n_near() && static_cast<int>(touched_.size()) < strings; ++k) {
    const int uav = current_.uav_of(near[k]);
    if (uav >= 0 && !is_touched_[uav]) tear(near[k], longest);
  }
}

// Take a string that holds `task` out of its list; sometimes keep some tasks inside the string.
void Search::tear(int task, double longest) {
  const int uav = current_.uav_of(task);
  const int size = static_cast<int>(current_.route(uav).size());
  const double most = std::min(longest, static_cast<double>(size));
  const int length = static_cast<int>(random_.uniform() * most + 1.0);  // at most `most`
  int kept = 0;
  if (length > 1 && length < size && random_.uniform() < kSplitShare) {
    kept = 1;
    while (length + kept < size && random_.uniform() > kSplitDepth) ++kept;
  }
  const int span = length + kept;
  const int here = current_.place_of(task);
  const int low = std::max(0, here - span + 1), high = std::min(here, size - span);
  const int begin = low + random_.below(high - low + 1);
  const int gap = kept == 0 ? span : 1 + random_.below(length);  // tasks torn before the kept ones
  keep_copy(uav);
  const Route& route = current_.route(uav);
  for (int k = 0; k < span; ++k)
    if (k < gap || k >= gap + kept)
      torn_.push_back({route[begin + k], current_.completion_s(uav, begin + k)});
  if (span > gap + kept) current_.remove(uav, begin + gap + kept, span - gap - kept);
  current_.remove(uav, begin, std::min(gap, length));
}

void Search::recreate() {
  const Problem& problem = current_.problem();
  const int kind = random_.below(10);
  order_.clear();
  for (const auto& [task, completion_s] : torn_) {
    double key;
    if (kind < 4) {
      key = random_.uniform();
    } else if (kind < 8) {
      key = -problem.value(task);
    } else {
      key = completion_s * (kind == 8 ? 1.0 : -1.0);
    }
    order_.emplace_back(key, task);
  }
  std::sort(order_.begin(), order_.end());
  for (const auto& [key, task] : order_) {
    Insertion best = best_insertion(task, true);
    if (best.uav < 0) best = best_insertion(task, false);
    keep_copy(best.uav);
    current_.insert(best.uav, best.place, task);
  }
}

void Search::run(long iterations, double temperature, Watch& watch) {
  if (tasks_.empty()) return;
  double value = current_.total();
  for (long iteration = 0; iteration < iterations; ++iteration) {
    if (watch.stops_after(kSteps)) return;
    value_before_ = 0.0;
    ruin();
    recreate();
    double gain = -value_before_;
    for (const int uav : touched_) gain += current_.route_value(uav);
    const bool accepted = gain > -temperature * random_.exponential();
    for (std::size_t k = 0; k < touched_.size(); ++k) {
      const int uav = touched_[k];
      is_touched_[uav] = 0;
      if (!accepted) {
        current_.restore(uav, copies_[k]);
      } else if (!current_.is_as(uav, copies_[k])) {
        versions_[uav] = ++last_version_;
        if (!is_unsaved_[uav]) unsaved_.push_back(uav);
        is_unsaved_[uav] = 1;
      }
    }
    touched_.clear();
    if (!accepted) continue;
    value += gain;
    if (value > best_value_) {
      best_value_ = value;
      for (const int uav : unsaved_) {
        best_[uav] = current_.route(uav);
        is_unsaved_[uav] = 0;
      }
      unsaved_.clear();
    }
  }
}

}  // namespace peckorder
