// Python face of the route optimiser; the work is done in routes_team.hpp and what it includes.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>

#include <utility>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "routes_binding.hpp"
#include "routes_bound.hpp"
#include "routes_local.hpp"
#include "routes_team.hpp"
#include "watch_binding.hpp"

namespace nb = nanobind;

namespace peckorder {

namespace {

using Table = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

template <class Array>
std::vector<double> copied(const Array& array) {
  return {array.data(), array.data() + array.size()};
}

// A search with the start it refers to.
class BoundSearch {
 public:
  BoundSearch(const Instance& instance, const StartArrays& start, const ListArrays& lists,
              const Mask& open, std::uint64_t seed)
      : start_(start.start(instance)),
        team_(instance, start_, lists.routes(), open_tasks(open), seed) {}

  void round(long iterations, double heat, int threads) {
    const nb::gil_scoped_release released;
    team_.round(iterations, heat, threads);
  }

  void polish(nb::handle should_stop) {
    PythonWatch(should_stop).released([&](Watch& watch) { team_.polish(watch); });
  }

  int n_lane() const { return team_.n_lane(); }
  double best_value() const { return team_.best_value(); }
  std::pair<IndexArray, IndexArray> best() const { return to_arrays(team_.best()); }

 private:
  Start start_;
  TeamSearch team_;
};

double local_search(const Instance& instance, const StartArrays& start, const ListArrays& lists,
                    Routes& improved) {
  const Start begin = start.start(instance);
  Solution solution(instance, begin);
  const std::vector<Route> routes = lists.routes();
  for (const int uav : solution.allowed()) solution.set_route(uav, routes[uav]);
  const nb::gil_scoped_release released;
  improve(solution, solution.allowed());
  improved = solution.routes();
  return solution.total();
}

}  // namespace

void bind_routes(nb::module_& module) {
  nb::class_<Instance>(module, "RouteInstance")
      .def(
          "__init__",
          [](Instance* self, const Matrix& task_m, const Vector& speed_m_s, const Vector& value,
             const Vector& service_s, const Matrix& success, const Matrix& survival,
             double horizon_s) {
            const MissionArrays arrays{static_cast<int>(speed_m_s.shape(0)),
                                       static_cast<int>(value.shape(0)),
                                       task_m.data(),
                                       speed_m_s.data(),
                                       value.data(),
                                       service_s.data(),
                                       success.data(),
                                       survival.data(),
                                       horizon_s};
            const nb::gil_scoped_release released;
            new (self) Instance(arrays);
          },
          nb::arg("task_m"), nb::arg("speed_m_s"), nb::arg("value"), nb::arg("service_s"),
          nb::arg("success"), nb::arg("survival"), nb::arg("horizon_s"));

  nb::class_<BoundSearch>(module, "RouteSearch")
      .def(
          "__init__",
          [](BoundSearch* self, const Instance& instance, const Vector& free_s,
             const Matrix& place_m, const Vector& survived, const Mask& active,
             const Indices& flat, const Indices& offsets, const Mask& open, std::uint64_t seed) {
            const nb::gil_scoped_release released;
            new (self) BoundSearch(instance, {free_s, place_m, survived, active}, {flat, offsets},
                                   open, seed);
          },
          nb::keep_alive<1, 2>(), nb::arg("instance"), nb::arg("free_s"), nb::arg("place_m"),
          nb::arg("survived"), nb::arg("active"), nb::arg("flat"), nb::arg("offsets"),
          nb::arg("open"), nb::arg("seed"))
      .def("round", &BoundSearch::round, nb::arg("iterations"), nb::arg("heat"),
           nb::arg("threads"))
      .def("polish", &BoundSearch::polish, nb::arg("should_stop") = nb::none())
      .def("n_lane", &BoundSearch::n_lane)
      .def("best_value", &BoundSearch::best_value)
      .def("best", &BoundSearch::best);

  module.def(
      "improve_routes",
      [](const Instance& instance, const Vector& free_s, const Matrix& place_m,
         const Vector& survived, const Mask& active, const Indices& flat,
         const Indices& offsets) {
        Routes improved;
        local_search(instance, {free_s, place_m, survived, active}, {flat, offsets}, improved);
        return to_arrays(improved);
      },
      nb::arg("instance"), nb::arg("free_s"), nb::arg("place_m"), nb::arg("survived"),
      nb::arg("active"), nb::arg("flat"), nb::arg("offsets"));

  module.def(
      "shortest_legs_s",
      [](const Instance& instance, const Vector& free_s, const Matrix& place_m,
         const Vector& survived, const Mask& active) {
        const Start start = StartArrays{free_s, place_m, survived, active}.start(instance);
        std::vector<double> legs_s;
        {
          const nb::gil_scoped_release released;
          legs_s = shortest_legs_s(instance, start);
        }
        return give(std::move(legs_s));
      },
      nb::arg("instance"), nb::arg("free_s"), nb::arg("place_m"), nb::arg("survived"),
      nb::arg("active"));

  nb::class_<Timetable>(module, "Timetable")
      .def(
          "__init__",
          [](Timetable* self, const Matrix& first_s, const Table& leg_s, const Matrix& earliest_s,
             const Matrix& latest_s) {
            new (self) Timetable{static_cast<int>(first_s.shape(1)), copied(first_s),
                                 copied(leg_s), copied(earliest_s), copied(latest_s)};
          },
          nb::arg("first_s"), nb::arg("leg_s"), nb::arg("earliest_s"), nb::arg("latest_s"));

  module.def(
      "priced_lists",
      [](const Instance& instance, const Vector& free_s, const Matrix& place_m,
         const Vector& survived, const Mask& active, const Mask& open, const Vector& prices,
         double bucket_s, const Timetable* timetable, long expansions, int threads,
         nb::handle should_stop) {
        const Start start = StartArrays{free_s, place_m, survived, active}.start(instance);
        const std::vector<int> tasks = open_tasks(open);
        const std::vector<double> price = copied(prices);
        std::vector<int> visits;
        double value;
        PythonWatch(should_stop).released([&](Watch& watch) {
          value = priced_lists(instance, start,
                               {tasks, price, bucket_s, timetable, expansions, threads}, visits,
                               watch);
        });
        return std::make_pair(value, to_array({visits.begin(), visits.end()}));
      },
      nb::arg("instance"), nb::arg("free_s"), nb::arg("place_m"), nb::arg("survived"),
      nb::arg("active"), nb::arg("open"), nb::arg("prices"), nb::arg("bucket_s"),
      nb::arg("timetable").none(), nb::arg("expansions"), nb::arg("threads"),
      nb::arg("should_stop") = nb::none());
}

}  // namespace peckorder
