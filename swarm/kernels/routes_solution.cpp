#include "routes_solution.hpp"

namespace peckorder {

Start::Start(const Problem& problem, const double* free, const double* place,
             const double* survival, const bool* takes_part)
    : free_s(free, free + problem.n_uav()),
      survived(survival, survival + problem.n_uav()),
      place_m(place, place + 3 * static_cast<std::size_t>(problem.n_uav())),
      active(takes_part, takes_part + problem.n_uav()) {
  problem.lay_out();
  travel_s_.resize(static_cast<std::size_t>(problem.n_uav()) * problem.n_task());
  for (int task = 0; task < problem.n_task(); ++task)
    for (int uav = 0; uav < problem.n_uav(); ++uav)
      travel_s_[at(uav, task)] =
          problem.quick_travel_s(uav, &place_m[3 * std::size_t(uav)], task);
}

Solution::Solution(const Problem& problem, const Start& start)
    : problem_(&problem),
      start_(&start),
      routes_(problem.n_uav()),
      value_(problem.n_uav(), 0.0),
      visit_(problem.n_task()),
      uav_of_(problem.n_task(), -1),
      place_of_(problem.n_task(), 0),
      is_allowed_(problem.n_uav(), 0) {
  std::vector<int> active;
  for (int uav = 0; uav < problem.n_uav(); ++uav)
    if (start.active[uav]) active.push_back(uav);
  restrict_to(active);
}

void Solution::restrict_to(const std::vector<int>& uavs) {
  for (Route& route : routes_) {
    for (const int task : route) uav_of_[task] = -1;
    route.clear();
  }
  value_.assign(value_.size(), 0.0);
  is_allowed_.assign(is_allowed_.size(), 0);
  allowed_ = uavs;
  for (const int uav : uavs) is_allowed_[uav] = 1;
}

void Solution::set_route(int uav, const Route& route) {
  for (const int task : routes_[uav])
    if (uav_of_[task] == uav) uav_of_[task] = -1;
  routes_[uav].assign(route.begin(), route.end());
  refresh(uav, 0);
}

void Solution::insert(int uav, int place, int task) {
  routes_[uav].insert(routes_[uav].begin() + place, task);
  refresh(uav, place);
}

void Solution::remove(int uav, int place, int count) {
  Route& route = routes_[uav];
  for (int k = place; k < place + count; ++k) uav_of_[route[k]] = -1;
  route.erase(route.begin() + place, route.begin() + place + count);
  refresh(uav, place);
}

void Solution::refresh(int uav, int from_place) {
  const Route& route = routes_[uav];
  const int size = static_cast<int>(route.size());
  const double horizon_s = problem_->horizon_s();
  for (int k = from_place; k < size; ++k) {
    const int task = route[k];
    uav_of_[task] = uav;
    place_of_[task] = k;
    visit_[task].completion_s = reach_s(uav, k, task);
    visit_[task].survived_after = survived_before(uav, k) * problem_->survival(uav, task);
  }
  double slope = 0.0, worth = 0.0;
  for (int k = size - 1; k >= 0; --k) {
    Visit& visit = visit_[route[k]];
    const double weight = problem_->weight(uav, route[k]);
    const double survival = problem_->survival(uav, route[k]);
    slope = weight + survival * slope;
    worth = weight * (horizon_s - visit.completion_s) + survival * worth;
    visit.slope = slope;
    visit.worth = worth;
  }
  value_[uav] = start_->survived[uav] * worth;
}

double Solution::total() const {
  double sum = 0.0;
  for (const int uav : allowed_) sum += value_[uav];
  return sum;
}

double Solution::mean_delay() const {
  double sum = 0.0;
  int count = 0;
  for (const int uav : allowed_) {
    double survived = start_->survived[uav];
    for (const int task : routes_[uav]) {
      sum += survived * problem_->weight(uav, task) *
             (visit_[task].completion_s - start_->free_s[uav]);
      survived = visit_[task].survived_after;
      ++count;
    }
  }
  return count == 0 ? 0.0 : sum / count;
}

double Solution::insertion_gain(int uav, int place, int task) const {
  const Route& route = routes_[uav];
  const double completion_s = reach_s(uav, place, task);
  double gain = problem_->weight(uav, task) * (problem_->horizon_s() - completion_s);
  if (place < static_cast<int>(route.size())) {
    const int next = route[place];
    const Visit& visit = visit_[next];
    const double delay_s =
        completion_s + problem_->leg_s(uav, task, next) - visit.completion_s;
    gain += problem_->survival(uav, task) * (visit.worth - delay_s * visit.slope) - visit.worth;
  }
  return survived_before(uav, place) * gain;
}

}  // namespace peckorder
