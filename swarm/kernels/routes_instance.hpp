// A mission and where its team stands, laid out for route kernels.
//
// Leaves out: routes themselves (routes_solution.hpp).
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "segment.hpp"

namespace peckorder {

// What is passed in; pointers to C-contiguous arrays that the caller has checked.
struct MissionArrays {
  int n_uav;
  int n_task;
  const double* task_m;       // (n_task, 3)
  const double* speed_m_s;    // (n_uav,)
  const double* value;        // (n_task,)
  const double* service_s;    // (n_task,)
  const double* success;      // (n_uav, n_task)
  const double* survival;     // (n_uav, n_task)
  double horizon_s;
};

class Instance {
 public:
  explicit Instance(const MissionArrays& arrays);

  int n_uav() const { return n_uav_; }
  int n_task() const { return n_task_; }
  double horizon_s() const { return horizon_s_; }
  bool certain() const { return certain_; }  // every survival probability is 1
  double pace(int uav) const { return pace_[uav]; }  // seconds per metre
  double value(int task) const { return value_[task]; }
  double service_s(int task) const { return service_s_[task]; }
  double weight(int uav, int task) const { return weight_[at(uav, task)]; }
  double survival(int uav, int task) const { return survival_[at(uav, task)]; }
  bool capable(int uav, int task) const { return capable_[at(uav, task)] != 0; }

  double distance_m(int a, int b) const {
    if (!distance_m_.empty()) return distance_m_[static_cast<std::size_t>(a) * n_task_ + b];
    return far_m(&task_m_[3 * static_cast<std::size_t>(a)], b);
  }

  // From any place (3 numbers) to a task.
  double far_m(const double* place_m, int task) const {
    const double* to = &task_m_[3 * static_cast<std::size_t>(task)];
    const double x = to[0] - place_m[0], y = to[1] - place_m[1], z = to[2] - place_m[2];
    return std::sqrt((x * x + y * y) + z * z);
  }

  // From completing a to completing b.
  double leg_s(int uav, int a, int b) const {
    return distance_m(a, b) * pace_[uav] + service_s_[b];
  }

  Segment task_segment(int uav, int task) const {
    return single(task, weight(uav, task), survival(uav, task), horizon_s_);
  }

  // Other tasks, nearest first; as many for each task.
  const double* place_m(int task) const {
    return &task_m_[3 * static_cast<std::size_t>(task)];
  }

  int n_near() const { return n_near_; }
  const std::int32_t* near(int task) const {
    return near_.data() + static_cast<std::size_t>(task) * n_near_;
  }

 private:
  std::size_t at(int uav, int task) const {
    return static_cast<std::size_t>(task) * n_uav_ + uav;  // one task's UAVs stand together
  }

  int n_uav_, n_task_, n_near_;
  double horizon_s_;
  bool certain_;
  std::vector<double> task_m_, pace_, value_, service_s_, weight_, survival_, distance_m_;
  std::vector<std::uint8_t> capable_;
  std::vector<std::int32_t> near_;
};

// Where each UAV begins.
struct Start {
  std::vector<double> free_s, survived, place_m;  // (n_uav,), (n_uav,), (n_uav, 3)
  std::vector<std::uint8_t> active;
  std::vector<double> distance_m;  // (n_uav, n_task) from each place

  Start(const Instance& instance, const double* free_s, const double* place_m,
        const double* survived, const bool* active);

  double first_m(int uav, int task) const { return distance_m[at(uav, task)]; }

 private:
  std::size_t at(int uav, int task) const {
    return static_cast<std::size_t>(task) * free_s.size() + uav;
  }
};

}  // namespace peckorder
