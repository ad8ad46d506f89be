#include "routes_granular.hpp"

#include <algorithm>
#include <limits>

namespace peckorder {

namespace {
constexpr double kLeastGain = 1e-13;  // of all that is added up: below is rounding
constexpr double kRuinFrac = 0.3;     // of the iterations
constexpr int kLongestBridged = 50;
constexpr int kMostTorn = 10;
constexpr int kMostStrings = 3;
constexpr int kNearToPutBack = 10;
constexpr int kSteps = 3000;  // of a watch, for an iteration
}  // namespace

GranularSearch::GranularSearch(const RouteTerms& terms, std::uint64_t seed)
    : lists_(terms),
      finder_(lists_),
      random_(seed),
      list_of_uav_(terms.n_uav(), -1),
      best_(terms.n_uav()),
      is_queued_(terms.n_task(), 0) {}

void GranularSearch::load(const std::vector<Route>& routes, const std::vector<int>& uavs) {
  uavs_ = uavs;
  lists_.load(routes, uavs);
  std::fill(list_of_uav_.begin(), list_of_uav_.end(), -1);
  tasks_.clear();
  for (int list = 0; list < lists_.n_list(); ++list)
    for (const int task : lists_.route(list)) tasks_.push_back(task);
  std::sort(tasks_.begin(), tasks_.end());
  for (std::size_t list = 0; list < uavs.size(); ++list) {
    list_of_uav_[uavs[list]] = static_cast<int>(list);
    best_[uavs[list]] = lists_.route(static_cast<int>(list));
  }
  best_value_ = lists_.total();
  least_ = kLeastGain * lists_.added_up() + 1e-12;
  for (const int task : queue_) is_queued_[task] = 0;
  queue_.clear();
  touched_.clear();
  unsaved_.clear();
  is_touched_.assign(lists_.n_list(), 0);
  is_unsaved_.assign(lists_.n_list(), 0);
  copies_.resize(lists_.n_list());
}

const Route& GranularSearch::current_route(int uav) const {
  return lists_.route(list_of_uav_[uav]);
}

void GranularSearch::keep(int list) {
  if (is_touched_[list]) return;
  is_touched_[list] = 1;
  copies_[touched_.size()] = lists_.route(list);
  touched_.push_back(list);
}

void GranularSearch::push(int task) {
  if (is_queued_[task]) return;
  is_queued_[task] = 1;
  queue_.push_back(task);
}

// The tasks on both sides of the joint before `place`.
void GranularSearch::push_around(int list, int place) {
  const Route& route = lists_.route(list);
  if (place > 0 && place <= static_cast<int>(route.size())) push(route[place - 1]);
  if (place >= 0 && place < static_cast<int>(route.size())) push(route[place]);
}

void GranularSearch::apply(const Recipe& recipe) {
  lists_.apply(recipe, [this](int list) { keep(list); });
  for (int k = 0; k < recipe.lists; ++k) {
    const int list = recipe.list[k];
    if (lists_.is_left_out(list)) continue;
    int place = 0;
    for (int p = 0; p < recipe.pieces[k]; ++p) {
      push_around(list, place);
      place += recipe.piece[k][p].size();
    }
  }
}

void GranularSearch::descend() {
  for (std::size_t next = 0; next < queue_.size(); ++next) {
    const int task = queue_[next];
    is_queued_[task] = 0;
    const Recipe& move = finder_.best(task, least_);
    if (move.lists == 0) continue;
    push(task);
    apply(move);
  }
  queue_.clear();
}

void GranularSearch::bridge() {
  const int task = tasks_[random_.below(static_cast<int>(tasks_.size()))];
  const int list = lists_.list_of(task);
  const int n = lists_.size(list);
  if (lists_.is_left_out(list) || n < 3) return ruin();
  const int most = std::min(kLongestBridged, n / 2);
  const int first = 1 + random_.below(most), second = 1 + random_.below(most);
  const int from = std::min(lists_.place_of(task), n - first - second);
  if (from < 0) return ruin();
  Recipe recipe;
  recipe.begin(list);
  recipe.add(list, 0, from);
  recipe.add(list, from + first, from + first + second);
  recipe.add(list, from, from + first);
  recipe.add(list, from + first + second, n);
  apply(recipe);
}

void GranularSearch::ruin() {
  const int seed = tasks_[random_.below(static_cast<int>(tasks_.size()))];
  torn_.clear();
  const RouteTerms& terms = lists_.terms();
  const int strings = 1 + random_.below(kMostStrings);
  std::size_t before = touched_.size();
  const auto tear = [&](int task) {
    const int list = lists_.list_of(task);
    if (list < 0) return;
    keep(list);
    if (lists_.is_left_out(list)) {
      torn_.push_back(task);
      scratch_ = lists_.route(list);
      scratch_.erase(scratch_.begin() + lists_.place_of(task));
      lists_.replace(list, scratch_);
      return;
    }
    const int n = lists_.size(list);
    const int length = 1 + random_.below(std::min(kMostTorn, n));
    const int before_task = random_.below(length);
    const int from = std::max(0, std::min(lists_.place_of(task) - before_task, n - length));
    scratch_ = lists_.route(list);
    torn_.insert(torn_.end(), scratch_.begin() + from, scratch_.begin() + from + length);
    scratch_.erase(scratch_.begin() + from, scratch_.begin() + from + length);
    lists_.replace(list, scratch_);
    push_around(list, from);
  };
  tear(seed);
  for (int k = 0; k < terms.n_near() && int(touched_.size() - before) < strings; ++k) {
    const int near = terms.near(seed)[k];
    const int list = lists_.list_of(near);
    if (list >= 0 && !is_touched_[list] &&
        std::find(torn_.begin(), torn_.end(), near) == torn_.end())
      tear(near);
  }
  for (std::size_t k = torn_.size(); k > 1; --k)
    std::swap(torn_[k - 1], torn_[random_.below(static_cast<int>(k))]);
  for (const int task : torn_) lists_.forget(task);
  for (const int task : torn_) put_back(task);
}

// Where it gains most, beside one of its near neighbours or at the front of a list.
void GranularSearch::put_back(int task) {
  const RouteTerms& terms = lists_.terms();
  int best_list = -1, best_place = 0;
  double best = terms.leaves_out() ? 0.0 : -std::numeric_limits<double>::infinity();
  const auto offer = [&](int list, int place) {
    const double gain = lists_.insertion_gain(list, place, task);
    if (gain > best) {
      best = gain;
      best_list = list;
      best_place = place;
    }
  };
  const int most = std::min(kNearToPutBack, terms.n_near());
  for (int k = 0; k < most; ++k) {
    const int list = lists_.list_of(terms.near(task)[k]);
    if (list < 0 || lists_.is_left_out(list)) continue;
    const int place = lists_.place_of(terms.near(task)[k]);
    offer(list, place);
    offer(list, place + 1);
  }
  for (int list = 0; list < lists_.n_list(); ++list)
    if (!lists_.is_left_out(list)) offer(list, 0);
  if (best_list < 0) {
    if (terms.leaves_out()) {
      best_list = lists_.n_list() - 1;
      best_place = lists_.size(best_list);
    } else {  // no near place is on a list that can take it
      for (int list = 0; list < lists_.n_list(); ++list)
        for (int place = 0; place <= lists_.size(list); ++place) offer(list, place);
    }
  }
  keep(best_list);
  scratch_ = lists_.route(best_list);
  scratch_.insert(scratch_.begin() + best_place, task);
  lists_.replace(best_list, scratch_);
  push(task);
  if (!lists_.is_left_out(best_list)) {
    push_around(best_list, best_place);
    push_around(best_list, best_place + 1);
  }
}

void GranularSearch::settle(const std::vector<int>& tasks) {
  for (const int task : tasks)
    if (lists_.list_of(task) < 0) put_back(task);
  for (const int task : tasks) push(task);
  descend();
  std::vector<Route> routes(lists_.terms().n_uav());
  for (const int uav : uavs_) routes[uav] = current_route(uav);
  load(routes, std::vector<int>(uavs_));
}

void GranularSearch::save_best() {
  best_value_ = lists_.total();
  for (const int list : unsaved_) {
    is_unsaved_[list] = 0;
    if (!lists_.is_left_out(list)) best_[lists_.uav(list)] = lists_.route(list);
  }
  unsaved_.clear();
}

void GranularSearch::run(long iterations, double temperature, Watch& watch) {
  if (tasks_.empty()) return;
  double value = lists_.total();
  for (long iteration = 0; iteration < iterations; ++iteration) {
    if (watch.stops_after(kSteps)) return;
    if (random_.uniform() < kRuinFrac)
      ruin();
    else
      bridge();
    descend();
    const double now = lists_.total();
    const bool accepted = now - value > -temperature * random_.exponential();
    for (std::size_t k = 0; k < touched_.size(); ++k) {
      const int list = touched_[k];
      is_touched_[list] = 0;
      if (!accepted) {
        lists_.replace(list, copies_[k]);
      } else if (!is_unsaved_[list]) {
        is_unsaved_[list] = 1;
        unsaved_.push_back(list);
      }
    }
    touched_.clear();
    if (!accepted) continue;
    value = now;
    if (value > best_value_ + least_) save_best();
  }
}

}  // namespace peckorder
