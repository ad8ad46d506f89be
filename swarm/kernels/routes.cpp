// Python face of the route optimiser; the work is done in routes_team.hpp and what it includes.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>

#include <optional>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "routes_binding.hpp"
#include "routes_local.hpp"
#include "routes_team.hpp"
#include "watch_binding.hpp"

namespace nb = nanobind;

namespace peckorder {

namespace {

template <class Array>
std::vector<double> copied(const Array& array) {
  return {array.data(), array.data() + array.size()};
}

// A search with the start it refers to.
class BoundSearch {
 public:
  BoundSearch(const Problem& problem, const StartArrays& start, const ListArrays& lists,
              const Mask& open, std::uint64_t seed, std::optional<GivenTimes> given)
      : start_(start.start(problem)),
        given_(std::move(given)),
        team_(problem, start_, lists.routes(), open_tasks(open), seed,
              given_ ? &*given_ : nullptr) {}

  void round(long iterations, double heat, int threads, nb::handle should_stop) {
    PythonWatch(should_stop).released(
        [&](Watch& watch) { team_.round(iterations, heat, threads, watch); });
  }

  void polish(nb::handle should_stop) {
    PythonWatch(should_stop).released([&](Watch& watch) { team_.polish(watch); });
  }

  int n_lane() const { return team_.n_lane(); }
  long most_iterations() const { return team_.most_iterations(); }
  double iterations_for_full_heat() const { return team_.iterations_for_full_heat(); }
  double best_value() const { return team_.best_value(); }
  std::pair<IndexArray, IndexArray> best() const { return to_arrays(team_.best()); }

 private:
  Start start_;
  std::optional<GivenTimes> given_;
  TeamSearch team_;
};

Routes local_search(const Problem& problem, const StartArrays& start, const ListArrays& lists) {
  const nb::gil_scoped_release released;
  const Start begin = start.start(problem);
  Solution solution(problem, begin);
  const Routes routes = lists.routes();
  for (const int uav : solution.allowed()) solution.set_route(uav, routes[uav]);
  improve(solution, solution.allowed());
  return solution.routes();
}

}  // namespace

void bind_routes(nb::module_& module) {
  nb::class_<BoundSearch>(module, "RouteSearch")
      .def(
          "__init__",
          [](BoundSearch* self, const Problem& problem, const Vector& free_s,
             const Matrix& place_m, const Vector& survived, const Mask& active,
             const Indices& flat, const Indices& offsets, const Mask& open, std::uint64_t seed,
             const std::optional<Vector>& given_first_s, const std::optional<Matrix>& given_leg_s,
             const std::optional<Vector>& given_due_s) {
            std::optional<GivenTimes> given;
            if (given_leg_s) {
              given.emplace();
              given->first_s = copied(*given_first_s);
              given->leg_s = copied(*given_leg_s);
              if (given_due_s) given->due_s = copied(*given_due_s);
            }
            const nb::gil_scoped_release released;
            new (self) BoundSearch(problem, {free_s, place_m, survived, active}, {flat, offsets},
                                   open, seed, std::move(given));
          },
          nb::keep_alive<1, 2>(), nb::arg("problem"), nb::arg("free_s"), nb::arg("place_m"),
          nb::arg("survived"), nb::arg("active"), nb::arg("flat"), nb::arg("offsets"),
          nb::arg("open"), nb::arg("seed"), nb::arg("given_first_s") = nb::none(),
          nb::arg("given_leg_s") = nb::none(), nb::arg("given_due_s") = nb::none())
      .def("round", &BoundSearch::round, nb::arg("iterations"), nb::arg("heat"),
           nb::arg("threads"), nb::arg("should_stop") = nb::none())
      .def("polish", &BoundSearch::polish, nb::arg("should_stop") = nb::none())
      .def("n_lane", &BoundSearch::n_lane)
      .def("most_iterations", &BoundSearch::most_iterations)
      .def("iterations_for_full_heat", &BoundSearch::iterations_for_full_heat)
      .def("best_value", &BoundSearch::best_value)
      .def("best", &BoundSearch::best);

  module.def(
      "improve_routes",
      [](const Problem& problem, const Vector& free_s, const Matrix& place_m,
         const Vector& survived, const Mask& active, const Indices& flat,
         const Indices& offsets) {
        return to_arrays(
            local_search(problem, {free_s, place_m, survived, active}, {flat, offsets}));
      },
      nb::arg("problem"), nb::arg("free_s"), nb::arg("place_m"), nb::arg("survived"),
      nb::arg("active"), nb::arg("flat"), nb::arg("offsets"));
}

}  // namespace peckorder
