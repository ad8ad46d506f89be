// Task lists of a team with everything an O(1) insertion test needs, kept per task.
//
// Leaves out: which changes to try (routes_search.hpp, routes_local.hpp).
#pragma once

#include <algorithm>
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

  // Who asks for few of the times to tasks needs no table of them all.
  Start(const Problem& problem, const double* free_s, const double* place_m,
        const double* survived, const bool* active, bool tabulates = true);

  // From where it begins to any task.
  double travel_s(int uav, int task) const {
    return travel_s_.empty() ? worked_out_s(uav, task) : travel_s_[at(uav, task)];
  }

 private:
  std::size_t at(int uav, int task) const {
    return static_cast<std::size_t>(task) * free_s.size() + uav;
  }
  double worked_out_s(int uav, int task) const {
    return problem_->quick_travel_s(uav, &place_m[3 * static_cast<std::size_t>(uav)], task);
  }

  const Problem* problem_;
  std::vector<double> travel_s_;  // (n_task, n_uav), or empty
};

struct Insertion {
  int uav = -1;
  int place = 0;
  double gain = -std::numeric_limits<double>::infinity();
};

class Solution {
 private:
  // What an insertion beside a task asks of it, together in memory.
  struct alignas(64) Visit {
    double place_m[3];
    double service_s;
    double completion_s;
    double survived_after;  // S after this task
    double slope;           // of the tail from this task on, with S = 1 before it
    double worth;           // of that tail at its present times, with S = 1 before it
  };
  // What a visit follows from.
  struct Cause {
    double leg_s;  // from the completion before it, or from nothing, to its own
    double weight, survival;
  };
  struct Flight {
    std::vector<Visit> visits;
    std::vector<Cause> causes;
    double value = 0.0;
  };

 public:
  // A list as it was.
  class Copy {
    friend class Solution;
    Route route;
    Flight flight;
  };

  Solution(const Problem& problem, const Start& start);

  const Problem& problem() const { return *problem_; }
  const Start& start() const { return *start_; }
  const Route& route(int uav) const { return routes_[uav]; }
  const std::vector<Route>& routes() const { return routes_; }
  double route_value(int uav) const { return flights_[uav].value; }
  int uav_of(int task) const { return uav_of_[task]; }  // -1: on no list
  int place_of(int task) const { return place_of_[task]; }
  double completion_s(int uav, int place) const {
    return flights_[uav].visits[place].completion_s;
  }
  // Distance of a place on a list from some point.
  double straight_m(int uav, int place, const double* from_m) const {
    return Problem::straight_m(from_m, flights_[uav].visits[place].place_m);
  }

  // Forget all lists; only these UAVs may be given tasks from now on.
  void restrict_to(const std::vector<int>& uavs);
  const std::vector<int>& allowed() const { return allowed_; }
  bool is_allowed(int uav) const { return is_allowed_[uav] != 0; }

  // Have the allowed UAVs' numbers at these tasks at hand, where a search takes most of its time to
  // get at them; others are asked of the problem.
  void gather(const std::vector<int>& tasks);

  void set_route(int uav, const Route& route);
  void insert(int uav, int place, int task);
  void remove(int uav, int place, int count);  // tasks at place..place+count-1

  void copy(int uav, Copy& copy) const;
  void restore(int uav, Copy& copy);  // which then holds the list that was replaced
  bool is_as(int uav, const Copy& copy) const { return routes_[uav] == copy.route; }

  double total() const;       // Σ over the allowed UAVs' lists
  double mean_delay() const;  // mean over tasks of S·w·(t − start): the scale of differences in J

  bool capable(int uav, int task) const {
    const Pairing* pairing = at_hand(uav, task);
    return pairing == nullptr ? problem_->capable(uav, task) : pairing->capable;
  }

  // Gain in J of inserting `task`, which is on no list, at `place` of `uav`'s list; where it is no
  // more than `least`, that or anything less.
  double insertion_gain(int uav, int place, int task,
                        double least = -std::numeric_limits<double>::infinity()) const;

  // The same at every place of the list, into gains[0..size], to the last bit.
  void insertion_gains(int uav, int task, double* gains) const;

  // Among the tasks at hand, -1 if it is not; among the allowed UAVs.
  int row(int task) const { return row_of_[task]; }
  int column(int uav) const { return column_of_[uav]; }

  // What the segment before `place` hands on: survival, and the first completion that follows.
  double survived_before(int uav, int place) const {
    return place == 0 ? start_->survived[uav] : flights_[uav].visits[place - 1].survived_after;
  }
  double reach_s(int uav, int place, int task) const {
    return ready_s(uav, place) + way_s(uav, place, task);
  }
  // The rest of the list from `place` on, as flown by its own UAV: slope, and worth as timed.
  double tail_slope(int uav, int place) const {
    return place == static_cast<int>(routes_[uav].size()) ? 0.0 : flights_[uav].visits[place].slope;
  }
  double tail_worth(int uav, int place) const {
    return place == static_cast<int>(routes_[uav].size()) ? 0.0 : flights_[uav].visits[place].worth;
  }

 private:
  // One UAV at one task.
  struct Pairing {
    double weight, survival, first_way_s;
    bool capable;
  };

  // Null where it was not gathered.
  const Pairing* at_hand(int uav, int task) const {
    const int row = row_of_[task];
    if (row < 0) return nullptr;
    return &pairings_[static_cast<std::size_t>(row) * allowed_.size() + column_of_[uav]];
  }
  Pairing pairing(int uav, int task) const {
    const Pairing* found = at_hand(uav, task);
    return found == nullptr ? worked_out(uav, task) : *found;
  }
  Pairing worked_out(int uav, int task) const {
    return {problem_->weight(uav, task), problem_->survival(uav, task),
            start_->travel_s(uav, task) + problem_->service_s(task), problem_->capable(uav, task)};
  }

  // When what stands before `place` is done, and from then to completing `task` there.
  double ready_s(int uav, int place) const {
    return place == 0 ? start_->free_s[uav] : flights_[uav].visits[place - 1].completion_s;
  }
  double way_s(int uav, int place, int task) const {
    if (place == 0) return pairing(uav, task).first_way_s;
    const double* from_m = flights_[uav].visits[place - 1].place_m;
    return problem_->quick_travel_s(uav, from_m, problem_->place_m(task)) +
           problem_->service_s(task);
  }

  void put(int uav, int place, int task);
  void refresh(int uav, int from_place);

  const Problem* problem_;
  const Start* start_;
  std::vector<Route> routes_;
  std::vector<Flight> flights_;
  std::vector<int> uav_of_, place_of_, allowed_;
  std::vector<int> column_of_, row_of_;  // of a UAV, and of a task or -1, among these:
  std::vector<Pairing> pairings_;
  std::vector<std::uint8_t> is_allowed_;
};

// The best of all places among the allowed UAVs, or, with many tasks, of those beside the task's
// near neighbours and at the front of each list.
Insertion best_insertion(const Solution& solution, int task);

}  // namespace peckorder
