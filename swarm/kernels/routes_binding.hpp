// How route kernels take lists and team states from NumPy, and give lists back.
//
// The Python faces have checked shapes, ranges and numbers.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstdint>
#include <utility>
#include <vector>

#include "routes_solution.hpp"

namespace peckorder {

namespace nb = nanobind;

using Vector = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Matrix = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Mask = nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Indices = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using IndexArray = nb::ndarray<nb::numpy, std::int64_t, nb::ndim<1>>;
using Routes = std::vector<Route>;

struct StartArrays {
  const Vector& free_s;
  const Matrix& place_m;
  const Vector& survived;
  const Mask& active;

  Start start(const Problem& problem, bool tabulates = true) const {
    return Start(problem, free_s.data(), place_m.data(), survived.data(), active.data(), tabulates);
  }
};

// List j is flat[offsets[j]] .. flat[offsets[j + 1] - 1].
struct ListArrays {
  const Indices& flat;
  const Indices& offsets;

  Routes routes() const {
    Routes routes(offsets.shape(0) - 1);
    for (std::size_t j = 0; j < routes.size(); ++j)
      routes[j].assign(flat.data() + offsets.data()[j], flat.data() + offsets.data()[j + 1]);
    return routes;
  }
};

inline std::vector<int> open_tasks(const Mask& open) {
  std::vector<int> tasks;
  for (std::size_t task = 0; task < open.shape(0); ++task)
    if (open.data()[task]) tasks.push_back(static_cast<int>(task));
  return tasks;
}

inline IndexArray to_array(const std::vector<std::int64_t>& numbers) {
  auto* kept = new std::vector<std::int64_t>(numbers);
  const nb::capsule owner(
      kept, [](void* p) noexcept { delete static_cast<std::vector<std::int64_t>*>(p); });
  return IndexArray(kept->data(), {kept->size()}, owner);
}

inline std::pair<IndexArray, IndexArray> to_arrays(const Routes& routes) {
  std::vector<std::int64_t> flat, offsets{0};
  for (const Route& route : routes) {
    flat.insert(flat.end(), route.begin(), route.end());
    offsets.push_back(static_cast<std::int64_t>(flat.size()));
  }
  return {to_array(flat), to_array(offsets)};
}

}  // namespace peckorder
