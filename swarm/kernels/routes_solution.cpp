#include "routes_solution.hpp"

#include <algorithm>
#include <utility>

namespace peckorder {

Start::Start(const Problem& problem, const double* free, const double* place,
             const double* survival, const bool* takes_part, bool tabulates)
    : free_s(free, free + problem.n_uav()),
      survived(survival, survival + problem.n_uav()),
      place_m(place, place + 3 * static_cast<std::size_t>(problem.n_uav())),
      active(takes_part, takes_part + problem.n_uav()),
      problem_(&problem) {
  problem.lay_out();
  if (!tabulates) return;
  travel_s_.resize(static_cast<std::size_t>(problem.n_uav()) * problem.n_task());
  for (int task = 0; task < problem.n_task(); ++task)
    for (int uav = 0; uav < problem.n_uav(); ++uav)
      travel_s_[at(uav, task)] = worked_out_s(uav, task);
}

Solution::Solution(const Problem& problem, const Start& start)
    : problem_(&problem),
      start_(&start),
      routes_(problem.n_uav()),
      flights_(problem.n_uav()),
      uav_of_(problem.n_task(), -1),
      place_of_(problem.n_task(), 0),
      column_of_(problem.n_uav(), 0),
      row_of_(problem.n_task(), -1),
      is_allowed_(problem.n_uav(), 0) {
  std::vector<int> active;
  for (int uav = 0; uav < problem.n_uav(); ++uav)
    if (start.active[uav]) active.push_back(uav);
  restrict_to(active);
}

void Solution::restrict_to(const std::vector<int>& uavs) {
  for (int uav = 0; uav < problem_->n_uav(); ++uav) {
    for (const int task : routes_[uav]) uav_of_[task] = -1;
    routes_[uav].clear();
    flights_[uav].visits.clear();
    flights_[uav].causes.clear();
    flights_[uav].value = 0.0;
  }
  is_allowed_.assign(is_allowed_.size(), 0);
  allowed_ = uavs;
  for (const int uav : uavs) is_allowed_[uav] = 1;
  if (!pairings_.empty()) row_of_.assign(row_of_.size(), -1);
  pairings_.clear();
}

void Solution::gather(const std::vector<int>& tasks) {
  for (std::size_t column = 0; column < allowed_.size(); ++column)
    column_of_[allowed_[column]] = static_cast<int>(column);
  pairings_.reserve(tasks.size() * allowed_.size());
  for (std::size_t row = 0; row < tasks.size(); ++row) {
    for (const int uav : allowed_) pairings_.push_back(worked_out(uav, tasks[row]));
    row_of_[tasks[row]] = static_cast<int>(row);
  }
}

void Solution::set_route(int uav, const Route& route) {
  for (const int task : routes_[uav])
    if (uav_of_[task] == uav) uav_of_[task] = -1;
  routes_[uav].assign(route.begin(), route.end());
  Flight& flight = flights_[uav];
  flight.visits.resize(route.size());
  flight.causes.resize(route.size());
  for (std::size_t k = 0; k < route.size(); ++k) put(uav, static_cast<int>(k), route[k]);
  refresh(uav, 0);
}

void Solution::insert(int uav, int place, int task) {
  Flight& flight = flights_[uav];
  routes_[uav].insert(routes_[uav].begin() + place, task);
  flight.visits.insert(flight.visits.begin() + place, Visit{});
  flight.causes.insert(flight.causes.begin() + place, Cause{});
  put(uav, place, task);
  if (place + 1 < static_cast<int>(routes_[uav].size()))
    flight.causes[place + 1].leg_s = way_s(uav, place + 1, routes_[uav][place + 1]);
  refresh(uav, place);
}

void Solution::remove(int uav, int place, int count) {
  Route& route = routes_[uav];
  Flight& flight = flights_[uav];
  for (int k = place; k < place + count; ++k) uav_of_[route[k]] = -1;
  const auto erase = [place, count](auto& of) {
    of.erase(of.begin() + place, of.begin() + place + count);
  };
  erase(route);
  erase(flight.visits);
  erase(flight.causes);
  if (place < static_cast<int>(route.size()))
    flight.causes[place].leg_s = way_s(uav, place, route[place]);
  refresh(uav, place);
}

void Solution::copy(int uav, Copy& copy) const {
  copy.route = routes_[uav];
  copy.flight = flights_[uav];
}

void Solution::restore(int uav, Copy& copy) {
  for (const int task : routes_[uav])
    if (uav_of_[task] == uav) uav_of_[task] = -1;
  std::swap(routes_[uav], copy.route);
  std::swap(flights_[uav], copy.flight);
  for (std::size_t k = 0; k < routes_[uav].size(); ++k) {
    uav_of_[routes_[uav][k]] = uav;
    place_of_[routes_[uav][k]] = static_cast<int>(k);
  }
}

// Whatever of a visit does not depend on the tasks after it nor on the time before it.
void Solution::put(int uav, int place, int task) {
  Visit& visit = flights_[uav].visits[place];
  std::copy_n(problem_->place_m(task), 3, visit.place_m);
  visit.service_s = problem_->service_s(task);
  const Pairing known = pairing(uav, task);
  flights_[uav].causes[place] = {way_s(uav, place, task), known.weight, known.survival};
}

void Solution::refresh(int uav, int from_place) {
  const Route& route = routes_[uav];
  Flight& flight = flights_[uav];
  const int size = static_cast<int>(route.size());
  const double horizon_s = problem_->horizon_s();
  double now_s = ready_s(uav, from_place), survived = survived_before(uav, from_place);
  for (int k = from_place; k < size; ++k) {
    uav_of_[route[k]] = uav;
    place_of_[route[k]] = k;
    now_s += flight.causes[k].leg_s;
    survived *= flight.causes[k].survival;
    flight.visits[k].completion_s = now_s;
    flight.visits[k].survived_after = survived;
  }
  double slope = 0.0, worth = 0.0;
  for (int k = size - 1; k >= 0; --k) {
    Visit& visit = flight.visits[k];
    const Cause& cause = flight.causes[k];
    slope = cause.weight + cause.survival * slope;
    worth = cause.weight * (horizon_s - visit.completion_s) + cause.survival * worth;
    visit.slope = slope;
    visit.worth = worth;
  }
  flight.value = start_->survived[uav] * worth;
}

double Solution::total() const {
  double sum = 0.0;
  for (const int uav : allowed_) sum += flights_[uav].value;
  return sum;
}

double Solution::mean_delay() const {
  double sum = 0.0;
  int count = 0;
  for (const int uav : allowed_) {
    const Flight& flight = flights_[uav];
    double survived = start_->survived[uav];
    for (std::size_t k = 0; k < flight.visits.size(); ++k, ++count) {
      sum += survived * flight.causes[k].weight *
             (flight.visits[k].completion_s - start_->free_s[uav]);
      survived = flight.visits[k].survived_after;
    }
  }
  return count == 0 ? 0.0 : sum / count;
}

// Gain = S·(w·(D − t) − delay·σ·slope − (1 − σ)·worth of the rest), and no delay is negative, since
// no way round is quicker.
double Solution::insertion_gain(int uav, int place, int task, double least) const {
  const std::vector<Visit>& visits = flights_[uav].visits;
  const Visit* next = place < static_cast<int>(visits.size()) ? &visits[place] : nullptr;
  const double survived = survived_before(uav, place);
  const Pairing* found = at_hand(uav, task);
  const double weight = found == nullptr ? problem_->weight(uav, task) : found->weight;
  double survival = 1.0;
  if (next != nullptr)
    survival = found == nullptr ? problem_->survival(uav, task) : found->survival;
  const double lost = next == nullptr ? 0.0 : (1.0 - survival) * next->worth;
  double completion_s = ready_s(uav, place) + problem_->service_s(task);
  if (survived * (weight * (problem_->horizon_s() - completion_s) - lost) <= least) return least;
  completion_s = reach_s(uav, place, task);
  const double most = survived * (weight * (problem_->horizon_s() - completion_s) - lost);
  if (next == nullptr || most <= least) return most;
  const double delay_s =
      completion_s +
      problem_->quick_travel_s(uav, problem_->place_m(task), next->place_m) + next->service_s -
      next->completion_s;
  return most - survived * survival * delay_s * next->slope;
}

void Solution::insertion_gains(int uav, int task, double* gains) const {
  const Visit* const visits = flights_[uav].visits.data();
  const int size = static_cast<int>(routes_[uav].size());
  const double* const here_m = problem_->place_m(task);
  const double service_s = problem_->service_s(task), horizon_s = problem_->horizon_s();
  const Pairing known = pairing(uav, task);
  double survived = start_->survived[uav];
  double completion_s = start_->free_s[uav] + known.first_way_s;
  for (int place = 0; place < size; ++place) {
    const Visit& next = visits[place];
    const double travel_s = problem_->quick_travel_s(uav, here_m, next.place_m);
    const double lost = (1.0 - known.survival) * next.worth;
    const double most = survived * (known.weight * (horizon_s - completion_s) - lost);
    const double delay_s = completion_s + travel_s + next.service_s - next.completion_s;
    gains[place] = most - survived * known.survival * delay_s * next.slope;
    survived = next.survived_after;
    completion_s = next.completion_s + (travel_s + service_s);
  }
  gains[size] = survived * (known.weight * (horizon_s - completion_s));
}

Insertion best_insertion(const Solution& solution, int task) {
  constexpr int kScanAllBelow = 150;
  constexpr int kManyTasks = 2000, kNear = 48, kNearOfMany = 32;
  const Problem& problem = solution.problem();
  Insertion best;
  const auto offer = [&](int uav, int place) {
    const double gain = solution.insertion_gain(uav, place, task, best.gain);
    if (gain > best.gain) best = {uav, place, gain};
  };
  const bool all = problem.n_task() <= kScanAllBelow;
  if (!all) {
    const double* here_m = problem.place_m(task);
    const std::int32_t* near = problem.near(task);
    const int most =
        std::min(problem.n_task() < kManyTasks ? kNear : kNearOfMany, problem.n_near());
    const double farthest_m = Problem::straight_m(here_m, problem.place_m(near[most - 1]));
    for (int k = 0; k < most; ++k) {
      const int uav = solution.uav_of(near[k]);
      if (uav < 0 || !solution.capable(uav, task)) continue;
      const int place = solution.place_of(near[k]);
      offer(uav, place + 1);
      // after a task that is as near, it is offered there
      if (place > 0 && solution.straight_m(uav, place - 1, here_m) >= farthest_m) offer(uav, place);
    }
  }
  for (const int uav : solution.allowed()) {
    if (!solution.capable(uav, task)) continue;
    const int size = static_cast<int>(solution.route(uav).size());
    for (int place = 0; place <= (all ? size : 0); ++place) offer(uav, place);
  }
  return best;
}

}  // namespace peckorder
