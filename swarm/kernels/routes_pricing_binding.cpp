// Python face of lists against prices, and of prices that suit lists; see routes_pricing.hpp and
// routes_bundle.hpp.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>

#include <tuple>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "routes_binding.hpp"
#include "routes_bound.hpp"
#include "routes_bundle.hpp"
#include "routes_pricing.hpp"
#include "watch_binding.hpp"

namespace peckorder {

namespace {

using Table = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

template <class Array>
std::vector<double> copied(const Array& array) {
  return {array.data(), array.data() + array.size()};
}

// Whether they are complete, bounds, worths before paying, lists.
auto given(bool done, std::vector<PricedList>& found) {
  std::vector<double> bound, worth;
  Routes lists;
  for (PricedList& one : found) {
    bound.push_back(one.bound);
    worth.push_back(one.worth);
    lists.push_back(std::move(one.list));
  }
  return std::make_tuple(done, give(std::move(bound)), give(std::move(worth)), to_arrays(lists));
}

// Whether none is missing, whose each is, worths before paying, lists.
auto given(bool all, std::vector<WorthyLists>& found) {
  std::vector<std::int64_t> uavs;
  std::vector<double> worth;
  Routes lists;
  for (std::size_t uav = 0; uav < found.size(); ++uav) {
    all = all && found[uav].all;
    for (std::size_t k = 0; k < found[uav].lists.size(); ++k) {
      uavs.push_back(static_cast<std::int64_t>(uav));
      worth.push_back(found[uav].worth[k]);
      lists.push_back(std::move(found[uav].lists[k]));
    }
  }
  return std::make_tuple(all, give(std::move(uavs)), give(std::move(worth)), to_arrays(lists));
}

}  // namespace

void bind_routes_pricing(nb::module_& module) {
  module.def(
      "price_lists",
      [](const Problem& problem, const Vector& free_s, const Matrix& place_m,
         const Vector& survived, const Mask& active, const Mask& open, const Vector& prices,
         long heads, int near, int threads, nb::handle should_stop) {
        const StartArrays arrays{free_s, place_m, survived, active};
        const std::vector<int> tasks = open_tasks(open);
        const std::vector<double> price = copied(prices);
        std::vector<PricedList> found;
        bool stopped = false;
        PythonWatch(should_stop).released([&](Watch& watch) {
          found = price_lists(problem, arrays.start(problem),
                              {tasks, price, heads, near, 0.0, threads}, watch);
          stopped = watch.stopped();
        });
        return given(!stopped, found);
      },
      nb::arg("problem"), nb::arg("free_s"), nb::arg("place_m"), nb::arg("survived"),
      nb::arg("active"), nb::arg("open"), nb::arg("prices"), nb::arg("heads"), nb::arg("near"),
      nb::arg("threads"), nb::arg("should_stop") = nb::none());

  module.def(
      "worthy_lists",
      [](const Problem& problem, const Vector& free_s, const Matrix& place_m,
         const Vector& survived, const Mask& active, const Mask& open, const Vector& prices,
         const Vector& most, double slack, long heads, int threads, nb::handle should_stop) {
        const StartArrays arrays{free_s, place_m, survived, active};
        const std::vector<int> tasks = open_tasks(open);
        const std::vector<double> price = copied(prices), bests = copied(most);
        std::vector<WorthyLists> found;
        bool all = true;
        PythonWatch(should_stop).released([&](Watch& watch) {
          found = worthy_lists(problem, arrays.start(problem),
                               {tasks, price, heads, 0, slack, threads}, bests, watch);
          all = !watch.stopped();
        });
        return given(all, found);
      },
      nb::arg("problem"), nb::arg("free_s"), nb::arg("place_m"), nb::arg("survived"),
      nb::arg("active"), nb::arg("open"), nb::arg("prices"), nb::arg("most"), nb::arg("slack"),
      nb::arg("heads"), nb::arg("threads"), nb::arg("should_stop") = nb::none());

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
      "relaxed_lists",
      [](const Problem& problem, const Vector& free_s, const Matrix& place_m,
         const Vector& survived, const Mask& active, const Mask& open, const Vector& prices,
         double bucket_s, const Timetable* timetable, long expansions, int threads,
         nb::handle should_stop) {
        const StartArrays arrays{free_s, place_m, survived, active};
        const std::vector<int> tasks = open_tasks(open);
        const std::vector<double> price = copied(prices);
        std::vector<PricedList> found;
        bool stopped = false;
        PythonWatch(should_stop).released([&](Watch& watch) {
          found = relaxed_lists(problem, arrays.start(problem),
                                {tasks, price, bucket_s, timetable, expansions, threads}, watch);
          stopped = watch.stopped();
        });
        return given(!stopped, found);
      },
      nb::arg("problem"), nb::arg("free_s"), nb::arg("place_m"), nb::arg("survived"),
      nb::arg("active"), nb::arg("open"), nb::arg("prices"), nb::arg("bucket_s"),
      nb::arg("timetable").none(), nb::arg("expansions"), nb::arg("threads"),
      nb::arg("should_stop") = nb::none());

  module.def(
      "worthy_timed_lists",
      [](const Problem& problem, const Vector& free_s, const Matrix& place_m,
         const Vector& survived, const Mask& active, const Mask& open, const Vector& prices,
         const Vector& most, double slack, double bucket_s, const Timetable* timetable, long heads,
         int threads, nb::handle should_stop) {
        const StartArrays arrays{free_s, place_m, survived, active};
        const std::vector<int> tasks = open_tasks(open);
        const std::vector<double> price = copied(prices), bests = copied(most);
        std::vector<WorthyLists> found;
        bool all = true;
        PythonWatch(should_stop).released([&](Watch& watch) {
          found = worthy_timed_lists(problem, arrays.start(problem),
                                     {tasks, price, bucket_s, timetable, heads, threads}, bests,
                                     slack, watch);
          all = !watch.stopped();
        });
        return given(all, found);
      },
      nb::arg("problem"), nb::arg("free_s"), nb::arg("place_m"), nb::arg("survived"),
      nb::arg("active"), nb::arg("open"), nb::arg("prices"), nb::arg("most"), nb::arg("slack"),
      nb::arg("bucket_s"), nb::arg("timetable").none(), nb::arg("heads"), nb::arg("threads"),
      nb::arg("should_stop") = nb::none());

  nb::class_<ListBundle>(module, "ListBundle")
      .def(
          "__init__",
          [](ListBundle* self, int n_uav, const Vector& prices) {
            new (self) ListBundle(n_uav, copied(prices));
          },
          nb::arg("n_uav"), nb::arg("prices"))
      .def(
          "add",
          [](ListBundle& self, const Indices& uavs, const Vector& worth, const Indices& flat,
             const Indices& offsets) {
            for (std::size_t k = 0; k < uavs.size(); ++k) {
              const Route list(flat.data() + offsets(k), flat.data() + offsets(k + 1));
              self.add(static_cast<int>(uavs(k)), list, worth(k));
            }
          },
          nb::arg("uavs"), nb::arg("worth"), nb::arg("flat"), nb::arg("offsets"))
      .def(
          "solve",
          [](ListBundle& self, double step, double tolerance, long sweeps,
             nb::handle should_stop) {
            PythonWatch(should_stop).released(
                [&](Watch& watch) { self.solve(step, tolerance, sweeps, watch); });
            return give(std::vector<double>(self.prices()));
          },
          nb::arg("step"), nb::arg("tolerance"), nb::arg("sweeps"),
          nb::arg("should_stop") = nb::none())
      .def("move_centre",
           [](ListBundle& self, const Vector& prices) { self.move_centre(copied(prices)); },
           nb::arg("prices"))
      .def("value", &ListBundle::value)
      .def("shares", [](const ListBundle& self) { return give(self.shares()); });
}

}  // namespace peckorder
