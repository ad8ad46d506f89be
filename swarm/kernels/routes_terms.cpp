#include "routes_terms.hpp"

#include <algorithm>
#include <utility>

namespace peckorder {

namespace {
constexpr int kMostNear = 30;
}  // namespace

RouteTerms::RouteTerms(const Problem& problem, const Start& start, const GivenTimes* given)
    : problem_(problem),
      start_(start),
      given_(given),
      class_(problem.n_uav()),
      near_(given == nullptr ? problem.near(0) : nullptr),
      n_near_(problem.n_near()) {
  find_classes();
  if (given != nullptr) find_near();
}

void RouteTerms::find_classes() {
  for (int uav = 0; uav < n_uav(); ++uav) {
    class_[uav] = uav;
    for (int other = 0; other < uav; ++other) {
      if (class_[other] != other) continue;
      if (start_.survived[uav] != start_.survived[other]) continue;
      if (!problem_.alike(uav, other)) continue;
      class_[uav] = other;
      break;
    }
  }
}

void RouteTerms::find_near() {
  const int n = n_task();
  n_near_ = std::min(kMostNear, n - 1);
  found_near_.reserve(static_cast<std::size_t>(n) * n_near_);
  std::vector<std::pair<double, int>> order;
  for (int task = 0; task < n; ++task) {
    order.clear();
    for (int other = 0; other < n; ++other)
      if (other != task) order.emplace_back(leg_s(0, task, other) + leg_s(0, other, task), other);
    std::partial_sort(order.begin(), order.begin() + n_near_, order.end());
    for (int k = 0; k < n_near_; ++k) found_near_.push_back(order[k].second);
  }
  near_ = found_near_.data();
}

}  // namespace peckorder
