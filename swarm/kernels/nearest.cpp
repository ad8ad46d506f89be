#include "nearest.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "problem.hpp"

namespace peckorder {

namespace {

constexpr double kPerCell = 4.0;  // places, if they are spread evenly

// Squares on the ground, and the places in each. Height only adds to a distance.
class Grid {
 public:
  Grid(const double* place_m, int n) : place_m_(place_m) {
    double high[2];
    for (int axis = 0; axis < 2; ++axis) {
      low_[axis] = std::numeric_limits<double>::infinity();
      high[axis] = -low_[axis];
      for (int k = 0; k < n; ++k) {
        low_[axis] = std::min(low_[axis], place_m[3 * std::size_t(k) + axis]);
        high[axis] = std::max(high[axis], place_m[3 * std::size_t(k) + axis]);
      }
    }
    const double east_m = high[0] - low_[0], north_m = high[1] - low_[1];
    const double most = std::max(1.0, n / kPerCell);  // cells
    cell_m_ = std::max(std::sqrt(east_m / most * north_m), std::max(east_m, north_m) / most);
    const bool one = !(cell_m_ > 0.0 && std::isfinite(cell_m_));
    for (int axis = 0; axis < 2; ++axis)
      cells_[axis] = one ? 1 : 1 + static_cast<int>((high[axis] - low_[axis]) / cell_m_);
    if (one) cell_m_ = std::numeric_limits<double>::max();
    first_.assign(static_cast<std::size_t>(cells_[0]) * cells_[1] + 1, 0);
    for (int k = 0; k < n; ++k) ++first_[index(cell(k, 0), cell(k, 1)) + 1];
    for (std::size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
    places_.resize(n);
    std::vector<int> next(first_.begin(), first_.end() - 1);
    for (int k = 0; k < n; ++k) places_[next[index(cell(k, 0), cell(k, 1))]++] = k;
  }

  double cell_m() const { return cell_m_; }
  int widest() const { return std::max(cells_[0], cells_[1]); }

  // Calls use(place) for each at most `rings` cells away, if none is `inner` rings or less away.
  template <class Use>
  void around(int place, int inner, int rings, const Use& use) const {
    const int x = cell(place, 0), y = cell(place, 1);
    for (int at_y = std::max(0, y - rings); at_y <= std::min(cells_[1] - 1, y + rings); ++at_y) {
      for (int at_x = std::max(0, x - rings); at_x <= std::min(cells_[0] - 1, x + rings); ++at_x) {
        if (std::abs(at_x - x) <= inner && std::abs(at_y - y) <= inner) continue;
        const std::size_t c = index(at_x, at_y);
        for (int k = first_[c]; k < first_[c + 1]; ++k) use(places_[k]);
      }
    }
  }

 private:
  int cell(int place, int axis) const {
    if (cells_[axis] == 1) return 0;
    const double at_m = place_m_[3 * std::size_t(place) + axis] - low_[axis];
    return std::min(cells_[axis] - 1, static_cast<int>(at_m / cell_m_));
  }
  std::size_t index(int x, int y) const { return static_cast<std::size_t>(y) * cells_[0] + x; }

  const double* place_m_;
  double low_[2];
  double cell_m_;
  int cells_[2];
  std::vector<int> first_, places_;  // of cell c: places_[first_[c]] .. places_[first_[c + 1] - 1]
};

}  // namespace

std::vector<std::int32_t> nearest(const double* place_m, int n, int count) {
  std::vector<std::int32_t> found;
  if (count <= 0) return found;
  found.reserve(static_cast<std::size_t>(n) * count);
  const Grid grid(place_m, n);
  std::vector<std::pair<double, int>> others;
  for (int place = 0; place < n; ++place) {
    others.clear();
    const double* from_m = place_m + 3 * std::size_t(place);
    const auto add = [&](int other) {
      if (other == place) return;
      const double away_m = Problem::straight_m(from_m, place_m + 3 * std::size_t(other));
      others.emplace_back(away_m, other);
    };
    int rings = -1;
    const auto look = [&](int farther) {
      grid.around(place, rings, farther, add);
      rings = farther;
    };
    while (static_cast<int>(others.size()) < count) look(rings < 1 ? rings + 1 : 2 * rings);
    std::nth_element(others.begin(), others.begin() + (count - 1), others.end());
    // all that is nearer than so many whole cells has been looked at; rounding is worth a thousandth
    const double needed = others[count - 1].first / grid.cell_m() * 1.001;
    if (needed > rings) look(std::min<double>(grid.widest(), needed + 1.0));
    std::nth_element(others.begin(), others.begin() + (count - 1), others.end());
    std::sort(others.begin(), others.begin() + count);
    for (int k = 0; k < count; ++k) found.push_back(others[k].second);
  }
  return found;
}

}  // namespace peckorder
