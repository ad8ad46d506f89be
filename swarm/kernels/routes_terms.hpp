// What lists of a team in which nobody is lost are made of: legs, and what tasks are worth when.
//
// A task that `uav` completes at t is worth prize − weight · t: of a mission p·m·D and p·m. Times of
// legs may be given instead of following from places, as those of published instances do; tasks may
// then have due times and be left out.
#pragma once

#include <cstdint>
#include <vector>

#include "routes_solution.hpp"

namespace peckorder {

// Times that do not follow from places, the same for every UAV.
struct GivenTimes {
  std::vector<double> first_s;  // (n_task,) completion as the first of a list
  std::vector<double> leg_s;    // (n_task, n_task) from completing one to completing another
  std::vector<double> due_s;    // (n_task,) worth is weight · (due − t), and it may be left out;
                                // empty: due at the horizon, and none is left out

  bool leaves_out() const { return !due_s.empty(); }
};

class RouteTerms {
 public:
  // `given` may be null. All three must live longer.
  RouteTerms(const Problem& problem, const Start& start, const GivenTimes* given);

  int n_uav() const { return problem_.n_uav(); }
  int n_task() const { return problem_.n_task(); }
  const Problem& problem() const { return problem_; }
  const Start& start() const { return start_; }
  bool leaves_out() const { return given_ != nullptr && given_->leaves_out(); }

  double leg_s(int uav, int from, int to) const {
    if (given_ != nullptr) return given_->leg_s[std::size_t(from) * n_task() + to];
    return problem_.leg_s(uav, from, to);
  }
  // Completion as the first of the list.
  double first_s(int uav, int task) const {
    if (given_ != nullptr) return given_->first_s[task];
    return start_.free_s[uav] + start_.travel_s(uav, task) + problem_.service_s(task);
  }
  // S · p · m, as a UAV that may be lost before its list began counts less.
  double weight(int uav, int task) const {
    return start_.survived[uav] * problem_.weight(uav, task);
  }
  double due_s(int task) const {
    return leaves_out() ? given_->due_s[task] : problem_.horizon_s();
  }
  bool capable(int uav, int task) const { return problem_.capable(uav, task); }

  // Whether two UAVs fly all legs between tasks in equal times, with equal weights.
  bool alike(int uav, int other) const { return class_[uav] == class_[other]; }

  int n_near() const { return n_near_; }
  const std::int32_t* near(int task) const {
    return near_ + static_cast<std::size_t>(task) * n_near_;
  }

 private:
  void find_classes();
  void find_near();

  const Problem& problem_;
  const Start& start_;
  const GivenTimes* given_;
  std::vector<int> class_;               // (n_uav,)
  std::vector<std::int32_t> found_near_;  // of given times
  const std::int32_t* near_;
  int n_near_;
};

}  // namespace peckorder
