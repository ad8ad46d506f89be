#include "routes_instance.hpp"

#include <algorithm>
#include <numeric>

namespace peckorder {

namespace {
constexpr int kMostNear = 48;
constexpr int kMostInTable = 1500;  // 18 MB of distances; beyond, computing costs less than memory
}  // namespace

Instance::Instance(const MissionArrays& arrays)
    : n_uav_(arrays.n_uav),
      n_task_(arrays.n_task),
      n_near_(std::max(0, std::min(kMostNear, arrays.n_task - 1))),
      horizon_s_(arrays.horizon_s),
      certain_(true),
      task_m_(arrays.task_m, arrays.task_m + 3 * static_cast<std::size_t>(arrays.n_task)),
      value_(arrays.value, arrays.value + arrays.n_task),
      service_s_(arrays.service_s, arrays.service_s + arrays.n_task) {
  const std::size_t cells = static_cast<std::size_t>(n_uav_) * n_task_;
  weight_.resize(cells);
  survival_.resize(cells);
  capable_.resize(cells);
  for (int uav = 0; uav < n_uav_; ++uav) {
    pace_.push_back(1.0 / arrays.speed_m_s[uav]);
    for (int task = 0; task < n_task_; ++task) {
      const std::size_t from = static_cast<std::size_t>(uav) * n_task_ + task;
      weight_[at(uav, task)] = arrays.success[from] * arrays.value[task];
      survival_[at(uav, task)] = arrays.survival[from];
      capable_[at(uav, task)] = arrays.success[from] > 0.0;
      certain_ = certain_ && (arrays.survival[from] == 1.0 || arrays.success[from] == 0.0);
    }
  }
  std::vector<double> row(n_task_);
  std::vector<std::int32_t> order(n_task_);
  if (n_task_ <= kMostInTable) distance_m_.resize(static_cast<std::size_t>(n_task_) * n_task_);
  near_.resize(static_cast<std::size_t>(n_task_) * n_near_);
  for (int task = 0; task < n_task_; ++task) {
    for (int to = 0; to < n_task_; ++to) row[to] = far_m(&task_m_[3 * std::size_t(task)], to);
    if (!distance_m_.empty())
      std::copy(row.begin(), row.end(), &distance_m_[static_cast<std::size_t>(task) * n_task_]);
    std::iota(order.begin(), order.end(), 0);
    order.erase(order.begin() + task);
    const auto nearer = [&](int a, int b) {
      return row[a] < row[b] || (row[a] == row[b] && a < b);
    };
    std::nth_element(order.begin(), order.begin() + n_near_, order.end(), nearer);
    std::sort(order.begin(), order.begin() + n_near_, nearer);
    std::copy_n(order.begin(), n_near_, near_.begin() + static_cast<std::size_t>(task) * n_near_);
    order.resize(n_task_);
  }
}

Start::Start(const Instance& instance, const double* free, const double* place,
             const double* survival, const bool* takes_part)
    : free_s(free, free + instance.n_uav()),
      survived(survival, survival + instance.n_uav()),
      place_m(place, place + 3 * static_cast<std::size_t>(instance.n_uav())),
      active(takes_part, takes_part + instance.n_uav()) {
  distance_m.resize(static_cast<std::size_t>(instance.n_uav()) * instance.n_task());
  for (int task = 0; task < instance.n_task(); ++task)
    for (int uav = 0; uav < instance.n_uav(); ++uav)
      distance_m[at(uav, task)] = instance.far_m(&place_m[3 * std::size_t(uav)], task);
}

}  // namespace peckorder
