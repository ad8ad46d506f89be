// Fortified rollout: what the team's lists are worth with each of a few first tasks.
#include "rollout.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include "bindings.hpp"
#include "routes_binding.hpp"
#include "routes_local.hpp"
#include "routes_search.hpp"

namespace peckorder {

namespace {

constexpr int kCandidates = 10;
constexpr double kTie = 1e-9;          // of the worth; less is no reason to leave the lists
constexpr double kHeat = 0.02;         // of the mean delay
constexpr std::uint64_t kSeed = 2005;  // every replica searches alike

// What bounds the work of a decision. Up to kFewTasks the place of a missing task is looked for
// everywhere, beyond that beside so many of the near tasks that are on lists.
constexpr int kFewTasks = 150;
constexpr int kNearToPlace = 10;
// UAVs whose lists are reconsidered, and tasks on these: the list that goes beyond is the last.
constexpr std::size_t kMostSearched = 12;
constexpr std::size_t kMostTasks = 56;
// Of a watch, for local search before the search and again after it.
constexpr std::int64_t kMostSteps = 40'000;

// Open tasks by m·p / (travel + service), best first.
std::vector<int> candidates(const Solution& solution, const std::vector<int>& open, int uav) {
  const Problem& problem = solution.problem();
  std::vector<std::pair<double, int>> order;
  for (const int task : open) {
    if (!problem.capable(uav, task)) continue;
    const double leg_s = solution.start().travel_s(uav, task) + problem.service_s(task);
    order.emplace_back(-problem.weight(uav, task) / (leg_s + 1e-9), task);
  }
  const std::size_t count = std::min<std::size_t>(kCandidates, order.size());
  std::partial_sort(order.begin(), order.begin() + count, order.end());
  std::vector<int> tasks;
  for (std::size_t k = 0; k < count; ++k) tasks.push_back(order[k].second);
  return tasks;
}

// J with `task` moved to the front of `uav`'s list; leaves `solution` as it was.
double worth_with_first(Solution& solution, int uav, int task, double total) {
  const int from = solution.uav_of(task);
  const Route own = solution.route(uav);
  const Route other = from >= 0 ? solution.route(from) : Route{};
  double worth = total - solution.route_value(uav);
  if (from >= 0 && from != uav) worth -= solution.route_value(from);
  if (from >= 0) solution.remove(from, solution.place_of(task), 1);
  solution.insert(uav, 0, task);
  worth += solution.route_value(uav);
  if (from >= 0 && from != uav) worth += solution.route_value(from);
  solution.set_route(uav, own);
  if (from >= 0 && from != uav) solution.set_route(from, other);
  return worth;
}

// Where J gains most by it, beside one of the near tasks or at the front of a UAV that is as near.
Insertion near_insertion(const Solution& solution, int task) {
  const Problem& problem = solution.problem();
  if (problem.n_task() <= kFewTasks) return best_insertion(solution, task);
  const double* here_m = problem.place_m(task);
  Insertion best;
  const auto offer = [&](int uav, int place) {
    const double gain = solution.insertion_gain(uav, place, task, best.gain);
    if (gain > best.gain) best = {uav, place, gain};
  };
  int farthest = -1;
  int found = 0;
  for (int k = 0; k < problem.n_near() && found < kNearToPlace; ++k) {
    const int near = problem.near(task)[k];
    const int uav = solution.uav_of(near);
    if (uav < 0 || !problem.capable(uav, task)) continue;
    offer(uav, solution.place_of(near));
    offer(uav, solution.place_of(near) + 1);
    farthest = near;
    ++found;
  }
  if (found < kNearToPlace) return best_insertion(solution, task);
  const double farthest_m = Problem::straight_m(here_m, problem.place_m(farthest));
  for (const int uav : solution.allowed()) {
    const double* start_m = &solution.start().place_m[3 * static_cast<std::size_t>(uav)];
    if (problem.capable(uav, task) && Problem::straight_m(here_m, start_m) <= farthest_m)
      offer(uav, 0);
  }
  return best;
}

void place_missing(Solution& solution, const std::vector<int>& open) {
  for (const int task : missing(solution, open)) {
    const Insertion best = near_insertion(solution, task);
    if (best.uav >= 0) solution.insert(best.uav, best.place, task);
  }
}

// The deciding UAV and those whose next places are nearest to it, ascending.
std::vector<int> near_uavs(const Solution& solution, int uav) {
  const Start& start = solution.start();
  const double* here = &start.place_m[3 * static_cast<std::size_t>(uav)];
  std::vector<std::pair<double, int>> order;
  for (const int other : solution.allowed()) {
    const double* there = &start.place_m[3 * static_cast<std::size_t>(other)];
    double nearest_m = Problem::straight_m(here, there);
    for (const int task : solution.route(other))
      nearest_m = std::min(nearest_m, Problem::straight_m(here, solution.problem().place_m(task)));
    order.emplace_back(other == uav ? -1.0 : nearest_m, other);
  }
  std::sort(order.begin(), order.end());
  std::vector<int> uavs;
  std::size_t tasks = 0;
  for (const auto& [nearest_m, other] : order) {
    if (uavs.size() == kMostSearched || tasks >= kMostTasks) break;
    uavs.push_back(other);
    tasks += solution.route(other).size();
  }
  std::sort(uavs.begin(), uavs.end());
  return uavs;
}

// What J loses if `task` is taken off its list.
double loss_without(const Solution& solution, int task) {
  const int uav = solution.uav_of(task);
  if (uav < 0) return 0.0;
  const int place = solution.place_of(task);
  double rest = 0.0;
  if (place + 1 < static_cast<int>(solution.route(uav).size())) {
    const int next = solution.route(uav)[place + 1];
    const double sooner_s =
        solution.completion_s(uav, place + 1) - solution.reach_s(uav, place, next);
    rest = solution.tail_worth(uav, place + 1) + sooner_s * solution.tail_slope(uav, place + 1);
  }
  return solution.survived_before(uav, place) * (solution.tail_worth(uav, place) - rest);
}

// Tells of UAVs with nothing on their lists whether one task would be worth more there. In a team
// that a search takes in as a whole nobody idles before it has been searched for.
class Openings {
 public:
  Openings(const Solution& solution, const std::vector<int>& open)
      : solution_(solution), enough_(kTie / 2.0 * std::abs(solution.total())) {
    for (const int task : open) offered_.emplace_back(task, loss_without(solution, task));
  }

  // `declined` of the allowed UAVs have had their turn already, and took nothing.
  bool idles(int uav, std::size_t declined = 0) const {
    if (solution_.allowed().size() - declined <= kMostSearched) return false;
    if (!solution_.route(uav).empty()) return false;
    return std::none_of(offered_.begin(), offered_.end(), [&](const auto& offer) {
      const auto& [task, loss] = offer;
      return solution_.capable(uav, task) &&
             solution_.insertion_gain(uav, 0, task) - loss > enough_;
    });
  }

 private:
  const Solution& solution_;
  const double enough_;  // half of what is a reason to leave the lists, as sums here are rounded
  std::vector<std::pair<int, double>> offered_;  // open tasks, and what their lists lose
};

void improve_briefly(Solution& solution, const std::vector<int>& uavs) {
  Watch budget(kMostSteps);
  improve(solution, uavs, budget);
}

void reconsider(Solution& solution, int uav, long iterations) {
  const std::vector<int> uavs = near_uavs(solution, uav);
  improve_briefly(solution, uavs);
  Search search(solution.problem(), solution.start(), kSeed);
  search.load(solution.routes(), uavs);
  const double hottest = kHeat * solution.mean_delay();
  constexpr int kSteps = 10;
  Watch never;
  for (int step = 0; step < kSteps; ++step)
    search.run(iterations / kSteps, hottest * (kSteps - step) / kSteps, never);
  for (const int other : uavs) solution.set_route(other, search.best_route(other));
  improve_briefly(solution, uavs);
}

}  // namespace

GuidedChoice guided_choice(const Problem& problem, const Start& start,
                           const std::vector<Route>& lists, const std::vector<int>& open, int uav,
                           long iterations) {
  Solution solution(problem, start);
  for (const int other : solution.allowed()) solution.set_route(other, lists[other]);
  place_missing(solution, open);
  const bool idles = solution.route(uav).empty() && Openings(solution, open).idles(uav);
  if (iterations > 0 && !idles) reconsider(solution, uav, iterations);
  GuidedChoice choice;
  const double total = solution.total();
  const Route& own = solution.route(uav);
  choice.planned = choice.task = own.empty() ? -1 : own.front();
  choice.worth = total;
  if (choice.planned >= 0) choice.valued.emplace_back(choice.planned, total);
  const double enough = total + kTie * std::abs(total);
  for (const int task : candidates(solution, open, uav)) {
    if (task == choice.planned) continue;
    const double worth = worth_with_first(solution, uav, task, total);
    choice.valued.emplace_back(task, worth);
    if (worth > enough && worth > choice.worth) {
      choice.task = task;
      choice.worth = worth;
    }
  }
  std::stable_sort(choice.valued.begin(), choice.valued.end(), [&](const auto& a, const auto& b) {
    if ((a.first == choice.task) != (b.first == choice.task)) return a.first == choice.task;
    return a.second > b.second;
  });
  const std::size_t others = choice.task >= 0 ? 1 : 0;
  choice.second = choice.valued.size() > others ? choice.valued[others].second
                                                : std::numeric_limits<double>::quiet_NaN();
  return choice;
}

int count_idle(const Problem& problem, const Start& start, const std::vector<Route>& lists,
               const std::vector<int>& open, const std::vector<int>& uavs) {
  Solution solution(problem, start);
  for (const int other : solution.allowed()) solution.set_route(other, lists[other]);
  place_missing(solution, open);
  const Openings openings(solution, open);
  std::size_t count = 0;
  while (count < uavs.size() && openings.idles(uavs[count], count)) ++count;
  return static_cast<int>(count);
}

void bind_rollout(nb::module_& module) {
  module.def(
      "count_idle",
      [](const Problem& problem, const Vector& free_s, const Matrix& place_m,
         const Vector& survived, const Mask& active, const Indices& flat, const Indices& offsets,
         const Mask& open, const std::vector<int>& uavs) {
        const StartArrays arrays{free_s, place_m, survived, active};
        const Routes lists = ListArrays{flat, offsets}.routes();
        const nb::gil_scoped_release released;
        return count_idle(problem, arrays.start(problem, false), lists, open_tasks(open), uavs);
      },
      nb::arg("problem"), nb::arg("free_s"), nb::arg("place_m"), nb::arg("survived"),
      nb::arg("active"), nb::arg("flat"), nb::arg("offsets"), nb::arg("open"), nb::arg("uavs"));
  module.def(
      "guided_choice",
      [](const Problem& problem, const Vector& free_s, const Matrix& place_m,
         const Vector& survived, const Mask& active, const Indices& flat, const Indices& offsets,
         const Mask& open, int uav, long iterations) {
        const StartArrays arrays{free_s, place_m, survived, active};
        const Routes lists = ListArrays{flat, offsets}.routes();
        GuidedChoice choice;
        {
          const nb::gil_scoped_release released;
          choice = guided_choice(problem, arrays.start(problem, false), lists, open_tasks(open),
                                 uav, iterations);
        }
        return std::make_tuple(choice.task, choice.worth, choice.second, choice.planned,
                               choice.valued);
      },
      nb::arg("problem"), nb::arg("free_s"), nb::arg("place_m"), nb::arg("survived"),
      nb::arg("active"), nb::arg("flat"), nb::arg("offsets"), nb::arg("open"), nb::arg("uav"),
      nb::arg("iterations"));
}

}  // namespace peckorder
