// The exact optimum of eq. 1: dynamic programming over task subsets per UAV (tours.hpp), then over
// the division of the tasks among the UAVs, 3^M combinations per UAV.
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <tuple>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "parallel.hpp"
#include "problem.hpp"
#include "tours.hpp"
#include "watch_binding.hpp"

namespace peckorder {

namespace {

using Size = std::size_t;
using Mask = std::uint32_t;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::int64_t kSubsetsPerStep = 8;  // of a Watch

// One UAV's tours over some tasks.
struct UavTours {
    UavTours(const Problem& problem, int uav, double sign, const std::vector<int>& tasks,
             Watch& watch) {
        const Size n = tasks.size();
        std::vector<double> weight(n), survival(n);
        completion_s.resize(n);
        for (Size i = 0; i < n; ++i) {
            weight[i] = sign * problem.weights(uav)[tasks[i]];
            survival[i] = problem.survivals(uav)[tasks[i]];
            completion_s[i] = problem.travel_s(uav, problem.start_m(uav), tasks[i]) +
                              problem.service_s(tasks[i]);
        }
        const std::vector<double> leg_s = problem.legs_s(uav, tasks);
        table = std::make_unique<TourTable>(static_cast<int>(n), weight.data(), survival.data(),
                                            leg_s.data(), problem.horizon_s(), watch);
    }

    std::vector<double> completion_s;
    std::unique_ptr<TourTable> table;
};

// Best worth of every subset of the universe for one UAV; -infinity where a task is beyond it.
std::vector<double> subset_values(const Problem& problem, int uav, double sign,
                                  const std::vector<int>& universe, Watch& watch) {
    std::vector<int> own;
    std::vector<Mask> bits;
    for (Size i = 0; i < universe.size(); ++i) {
        if (problem.abilities(uav)[universe[i]]) {
            own.push_back(universe[i]);
            bits.push_back(Mask{1} << i);
        }
    }
    const UavTours tours(problem, uav, sign, own, watch);
    if (watch.stopped()) return {};
    std::vector<double> inside(Size{1} << own.size());
    tours.table->values(tours.completion_s.data(), inside.data(), watch);
    std::vector<double> values(Size{1} << universe.size(), -kInfinity);
    std::vector<Mask> spread(inside.size(), 0);
    for (Size s = 0; s < inside.size(); ++s) {
        if (s) {
            Size low = 0;
            while (!(s >> low & 1)) ++low;
            spread[s] = spread[s & (s - 1)] | bits[low];
        }
        values[spread[s]] = inside[s];
    }
    return values;
}

// For every set the best of first[set without s] + second[s] over its subsets s.
std::vector<double> divide(const std::vector<double>& first, const std::vector<double>& second,
                           int threads, Watch& watch) {
    std::vector<double> best(first.size());
    parallel_for(first.size(), threads, 256, [&] {
        return [&](Size job) {
            const Mask set = static_cast<Mask>(job);
            if (watch.stopped()) return;
            std::int64_t looked = 0;
            double most = first[set] + second[0];
            for (Mask s = set; s; s = (s - 1) & set) {
                const double worth = first[set ^ s] + second[s];
                most = worth > most ? worth : most;
                ++looked;
            }
            best[set] = most;
            watch.stops_after(looked / kSubsetsPerStep + 1);
        };
    });
    return best;
}

using Lists = std::vector<std::vector<int>>;

// The best lists of the tasks in the universe, and what they are worth; of no use once the watch
// has stopped it.
double best_lists(const Problem& problem, const std::vector<int>& universe, double sign,
                  int threads, Watch& watch, Lists& routes) {
    const Size n_uav = static_cast<Size>(problem.n_uav());
    std::vector<std::vector<double>> own(n_uav), best(n_uav);
    parallel_for(n_uav, threads, 1, [&] {
        return [&](Size uav) {
            own[uav] = subset_values(problem, static_cast<int>(uav), sign, universe, watch);
        };
    });
    if (watch.stopped()) return 0.0;
    best[0] = own[0];  // best[j][subset]: its worth divided among UAVs 0..j
    for (Size j = 1; j + 1 < n_uav; ++j) best[j] = divide(best[j - 1], own[j], threads, watch);
    double objective = 0.0;
    Mask left = static_cast<Mask>((Size{1} << universe.size()) - 1);
    for (Size j = n_uav; j-- > 0 && !watch.stopped();) {
        Mask chosen = left;
        double most_worth = j ? best[j - 1][left] + own[j][0] : best[0][left];
        if (j) {
            chosen = 0;
            for (Mask s = (0 - left) & left; s; s = (s - left) & left) {
                const double worth = best[j - 1][left ^ s] + own[j][s];
                if (worth > most_worth) {
                    most_worth = worth;
                    chosen = s;
                }
            }
        }
        if (j + 1 == n_uav) objective = most_worth;
        std::vector<int> tasks;
        for (Size i = 0; i < universe.size(); ++i) {
            if (chosen >> i & 1) tasks.push_back(universe[i]);
        }
        const UavTours tours(problem, static_cast<int>(j), sign, tasks, watch);
        if (watch.stopped()) break;
        const Mask all = static_cast<Mask>((Size{1} << tasks.size()) - 1);
        for (const int place : tours.table->best_tour(all, tours.completion_s.data())) {
            routes[j].push_back(tasks[static_cast<Size>(place)]);
        }
        left ^= chosen;
    }
    return objective;
}

std::tuple<double, Lists> optimum(const Problem& problem, bool worst, int threads,
                                  nb::handle should_stop) {
    const double sign = worst ? -1.0 : 1.0;
    const Size n_uav = static_cast<Size>(problem.n_uav());
    std::vector<int> universe;
    for (int task = 0; task < problem.n_task(); ++task) {
        bool possible = false;
        for (int uav = 0; uav < problem.n_uav() && !possible; ++uav) {
            possible = problem.abilities(uav)[task] != 0;
        }
        if (possible) universe.push_back(task);
    }
    const int most = problem.certain() ? TourTable::kMostTasks : TourTable::kMostUncertainTasks;
    if (universe.size() > static_cast<Size>(most)) {
        refuse("problem must have at most " + std::to_string(most) + " tasks");
    }
    if (threads < 1 || threads > 1024) refuse("threads must be within 1..1024");
    Lists routes(n_uav);
    double objective = 0.0;
    bool stopped = false;
    if (!universe.empty()) {
        PythonWatch(should_stop).released([&](Watch& watch) {
            objective = best_lists(problem, universe, sign, threads, watch, routes);
            stopped = watch.stopped();
        });
    }
    if (stopped) return {std::numeric_limits<double>::quiet_NaN(), Lists(n_uav)};
    return {worst ? 0.0 - objective : objective, std::move(routes)};
}

}  // namespace

void bind_exact(nb::module_& module) {
    module.attr("MOST_TASKS") = TourTable::kMostTasks;
    module.attr("MOST_UNCERTAIN_TASKS") = TourTable::kMostUncertainTasks;
    module.def("optimum", &optimum, nb::arg("problem"), nb::arg("worst"), nb::arg("threads"),
               nb::arg("should_stop") = nb::none());
}

}  // namespace peckorder
