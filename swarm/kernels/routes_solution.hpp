// Task lists of a team with everything an O(1) insertion test needs, kept per task.
//
// Leaves out: which changes to try (routes_search.hpp, routes_local.hpp).
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "problem.hpp"
#include "segment.hpp"

namespace peckorder {

using Route = std::vector<int>;

// Where each UAV begins. Lays out the problem, whose route kernels all ask for this first.
class Start {
 public:
  std::vector<double> free_s, survived, place_m;  // (n_uav,), (n_uav,), (n_uav, 3)
  std::vector<std::uint8_t> active;

  Start(const Problem& problem, const double* free_s, const double* place_m,
        const double* survived, const bool* active);

  // From where it begins to any task.
  double travel_s(int uav, int task) const { return travel_s_[at(uav, task)]; }

 private:
  std::size_t at(int uav, int task) const {
    return static_cast<std::size_t>(task) * free_s.size() + uav;
  }

  std::vector<double> travel_s_;  // (n_task, n_uav)
};

struct Insertion {
  int uav = -1;
  int place = 0;
  double gain = -std::numeric_limits<double>::infinity();
};

class Solution {
 public:
  Solution(const Problem& problem, const Start& start);

  const Problem& problem() const { return *problem_; }
  const Start& start() const { return *start_; }
  const Route& route(int uav) const { return routes_[uav]; }
  const std::vector<Route>& routes() const { return routes_; }
  double route_value(int uav) const { return value_[uav]; }
  int uav_of(int task) const { return uav_of_[task]; }  // -1: on no list
  int place_of(int task) const { return place_of_[task]; }
  double completion_s(int task) const { return visit_[task].completion_s; }

  // Forget all lists; only these UAVs may be given tasks from now on.
  void restrict_to(const std::vector<int>& uavs);
  const std::vector<int>& allowed() const { return allowed_; }
  bool is_allowed(int uav) const { return is_allowed_[uav] != 0; }

  void set_route(int uav, const Route& route);
  void insert(int uav, int place, int task);
  void remove(int uav, int place, int count);  // tasks at place..place+count-1

  double total() const;       // Σ over the allowed UAVs' lists
  double mean_delay() const;  // mean over tasks of S·w·(t − start): the scale of differences in J

  // Gain in J of inserting `task`, which is on no list, at `place` of `uav`'s list.
  double insertion_gain(int uav, int place, int task) const;

  // What the segment before `place` hands on: survival, and the first completion that follows.
  double survived_before(int uav, int place) const {
    return place == 0 ? start_->survived[uav] : visit_[routes_[uav][place - 1]].survived_after;
  }
  double reach_s(int uav, int place, int task) const {
    if (place == 0)
      return start_->free_s[uav] + start_->travel_s(uav, task) + problem_->service_s(task);
    const int before = routes_[uav][place - 1];
    return visit_[before].completion_s + problem_->leg_s(uav, before, task);
  }
  // The rest of the list from `place` on, as flown by its own UAV: slope, and worth as timed.
  double tail_slope(int uav, int place) const {
    return place == static_cast<int>(routes_[uav].size()) ? 0.0 : visit_[routes_[uav][place]].slope;
  }
  double tail_worth(int uav, int place) const {
    return place == static_cast<int>(routes_[uav].size()) ? 0.0 : visit_[routes_[uav][place]].worth;
  }

 private:
  struct Visit {
    double completion_s;
    double survived_after;  // S after this task
    double slope;           // of the tail from this task on, with S = 1 before it
    double worth;           // of that tail at its present times, with S = 1 before it
  };

  void refresh(int uav, int from_place);

  const Problem* problem_;
  const Start* start_;
  std::vector<Route> routes_;
  std::vector<double> value_;
  std::vector<Visit> visit_;
  std::vector<int> uav_of_, place_of_, allowed_;
  std::vector<std::uint8_t> is_allowed_;
};

// The best of all places among the allowed UAVs, or, with many tasks, of those beside the task's
// near neighbours and at the front of each list. `skip` drops a candidate where it returns true.
template <class Skip>
Insertion best_insertion(const Solution& solution, int task, Skip&& skip) {
  constexpr int kScanAllBelow = 150;
  const Problem& problem = solution.problem();
  Insertion best;
  const auto offer = [&](int uav, int place) {
    if (skip()) return;
    const double gain = solution.insertion_gain(uav, place, task);
    if (gain > best.gain) best = {uav, place, gain};
  };
  const bool all = problem.n_task() <= kScanAllBelow;
  for (const int uav : solution.allowed()) {
    if (!problem.capable(uav, task)) continue;
    const int size = static_cast<int>(solution.route(uav).size());
    for (int place = 0; place <= (all ? size : 0); ++place) offer(uav, place);
  }
  if (all) return best;
  const std::int32_t* near = problem.near(task);
  for (int k = 0; k < problem.n_near(); ++k) {
    const int uav = solution.uav_of(near[k]);
    if (uav < 0 || !problem.capable(uav, task)) continue;
    const int place = solution.place_of(near[k]);
    if (place > 0) offer(uav, place);
    offer(uav, place + 1);
  }
  return best;
}

inline Insertion best_insertion(const Solution& solution, int task) {
  return best_insertion(solution, task, [] { return false; });
}

}  // namespace peckorder
