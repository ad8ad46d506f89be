// The prepared mission and its checks; see problem.hpp.
#include "problem.hpp"

#include <nanobind/stl/optional.h>

#include <algorithm>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "arrays.hpp"
#include "bindings.hpp"
#include "nearest.hpp"
#include "rules.hpp"

namespace peckorder {

namespace {
constexpr int kTogether = 32;  // tasks whose rows stay in cache while UAVs are gone through
constexpr int kMostNear = 48;
constexpr int kMostInTable = 1500;  // 18 MB of distances; beyond, computing costs less than memory
}  // namespace

Problem::Problem(const MissionArrays& arrays)
    : n_uav_(arrays.n_uav),
      n_task_(arrays.n_task),
      horizon_s_(arrays.horizon_s),
      start_m_(arrays.start_m, arrays.start_m + 3 * static_cast<std::size_t>(n_uav_)),
      task_m_(arrays.task_m, arrays.task_m + 3 * static_cast<std::size_t>(n_task_)),
      speed_m_s_(arrays.speed_m_s, arrays.speed_m_s + n_uav_),
      value_(arrays.value, arrays.value + n_task_),
      service_s_(arrays.service_s, arrays.service_s + n_task_) {
    for (int uav = 0; uav < n_uav_; ++uav) {
        const double* const given_m_s2 = arrays.acceleration_m_s2;
        pace_s_m_.push_back(1.0 / speed_m_s_[uav]);
        ramps_.push_back(given_m_s2 ? Ramps(speed_m_s_[uav], given_m_s2[uav]) : Ramps());
        at_once_ = at_once_ && ramps_.back().at_once();
    }
    by_uav_ = table();
    // Through local pointers: for all the compiler knows, a byte that is stored in a table could be
    // one of this object, whose members it would read anew for every cell.
    const double* const value = value_.data();
    const int n_task = n_task_;
    for (int uav = 0; uav < n_uav_; ++uav) {
        const double* const success = arrays.success + row(uav);
        const double* const survival = arrays.survival + row(uav);
        double* const weight = by_uav_.weight.data() + row(uav);
        std::uint8_t* const capable = by_uav_.capable.data() + row(uav);
        bool all = true, certain = true;
        for (int task = 0; task < n_task; ++task) weight[task] = success[task] * value[task];
        for (int task = 0; task < n_task; ++task) {
            const bool can = success[task] > 0.0;
            capable[task] = can;
            all &= can;
            certain &= !can | (survival[task] == 1.0);
        }
        std::copy(survival, survival + n_task, by_uav_.survival.data() + row(uav));
        capable_of_all_.push_back(all);
        certain_ = certain_ && certain;
    }
}

Problem::~Problem() = default;

std::vector<double> Problem::legs_s(int uav, const std::vector<int>& tasks) const {
    std::vector<double> legs_s(tasks.size() * tasks.size());
    double* leg_s = legs_s.data();
    for (const int from : tasks) {
        for (const int to : tasks) *leg_s++ = travel_s(uav, from, to) + service_s(to);
    }
    return legs_s;
}

bool Problem::alike(int uav, int other) const {
    const auto same = [&](const auto& table) {
        const auto* const a = table.data() + row(uav);
        return std::equal(a, a + n_task_, table.data() + row(other));
    };
    return speed_m_s_[uav] == speed_m_s_[other] &&
           ramps_[uav].acceleration_m_s2 == ramps_[other].acceleration_m_s2 &&
           same(by_uav_.weight) && same(by_uav_.survival) && same(by_uav_.capable);
}

void Problem::lay_out() const {
    std::call_once(laid_out_, [this] {
        turn_table();
        find_near();
    });
}

Problem::Table Problem::table() const {
    const std::size_t cells = static_cast<std::size_t>(n_uav_) * n_task_;
    return {std::vector<double>(cells), std::vector<double>(cells),
            std::vector<std::uint8_t>(cells)};
}

void Problem::turn_table() const {
    by_task_ = table();
    for (int first = 0; first < n_task_; first += kTogether) {
        const int end = std::min(n_task_, first + kTogether);
        for (int uav = 0; uav < n_uav_; ++uav) {
            for (int task = first; task < end; ++task) {
                const std::size_t from = row(uav) + task, to = column(uav, task);
                by_task_.weight[to] = by_uav_.weight[from];
                by_task_.survival[to] = by_uav_.survival[from];
                by_task_.capable[to] = by_uav_.capable[from];
            }
        }
    }
}

void Problem::find_near() const {
    n_near_ = std::max(0, std::min(kMostNear, n_task_ - 1));
    near_ = nearest(task_m_.data(), n_task_, n_near_);
    between_m_.clear();
    if (n_task_ > kMostInTable) return;
    between_m_.reserve(static_cast<std::size_t>(n_task_) * n_task_);
    for (int task = 0; task < n_task_; ++task) {
        for (int to = 0; to < n_task_; ++to)
            between_m_.push_back(straight_m(place_m(task), place_m(to)));
    }
}

std::unique_ptr<Workspace> Problem::borrow_workspace() const {
    {
        const std::lock_guard<std::mutex> held(mutex_);
        if (!idle_.empty()) {
            std::unique_ptr<Workspace> workspace = std::move(idle_.back());
            idle_.pop_back();
            return workspace;
        }
    }
    return std::make_unique<Workspace>();
}

void Problem::return_workspace(std::unique_ptr<Workspace> workspace) const {
    const std::lock_guard<std::mutex> held(mutex_);
    idle_.push_back(std::move(workspace));
}

namespace {

using Given = In<double, 1>;
using GivenTable = In<double, 2>;

constexpr double kMost = std::numeric_limits<double>::max();
constexpr double kLeast = std::numeric_limits<double>::denorm_min();

template <typename Array>
void require_all(const char* name, const Array& array, double low, double high,
                 const char* range) {
    bool right = true;  // without a way out, which would keep the loop from being vectorised
    for (std::size_t i = 0; i < array.size(); ++i) {
        right &= (array.data()[i] >= low) & (array.data()[i] <= high);
    }
    for (std::size_t i = 0; !right && i < array.size(); ++i) {
        require_within(name, array.data()[i], low, high, range);
    }
}

// The only place where numbers of a mission are checked, whoever makes a problem.
MissionArrays checked(const GivenTable& start_enu_m, const GivenTable& task_enu_m,
                      const Given& speed_m_s, const Given& value, const Given& service_s,
                      const GivenTable& success, const GivenTable& survival, double horizon_s,
                      const std::optional<Given>& acceleration_m_s2) {
    const std::size_t n_uav = speed_m_s.shape(0), n_task = value.shape(0);
    if (n_uav > 100'000 || n_task > 1'000'000) refuse("speed_m_s or value is too long");
    require_shape("start_enu_m", start_enu_m, {n_uav, 3});
    require_shape("task_enu_m", task_enu_m, {n_task, 3});
    require_shape("service_s", service_s, {n_task});
    require_shape("success", success, {n_uav, n_task});
    require_shape("survival", survival, {n_uav, n_task});
    require_finite("start_enu_m", start_enu_m.data(), start_enu_m.size());
    require_finite("task_enu_m", task_enu_m.data(), task_enu_m.size());
    require_all("speed_m_s", speed_m_s, kLeast, kMost, "> 0 and finite");
    require_all("value", value, 0.0, kMost, ">= 0 and finite");
    require_all("service_s", service_s, 0.0, kMost, ">= 0 and finite");
    require_all("success", success, 0.0, 1.0, "within 0..1");
    require_all("survival", survival, 0.0, 1.0, "within 0..1");
    require_within("horizon_s", horizon_s, kLeast, kMost, "> 0 and finite");
    if (acceleration_m_s2) {
        require_shape("acceleration_m_s2", *acceleration_m_s2, {n_uav});
        require_all("acceleration_m_s2", *acceleration_m_s2, kLeast,
                    std::numeric_limits<double>::infinity(), "> 0");
    }
    return {static_cast<int>(n_uav), static_cast<int>(n_task), start_enu_m.data(),
            task_enu_m.data(),       speed_m_s.data(),         value.data(),
            service_s.data(),        success.data(),           survival.data(),
            horizon_s,               acceleration_m_s2 ? acceleration_m_s2->data() : nullptr};
}

// What a problem keeps, for reading.
template <typename T, typename Kept>
nb::ndarray<nb::numpy, const T, nb::ndim<2>> view(nb::handle owner, const Problem& problem,
                                                  const Kept* first) {
    const std::size_t shape[2] = {static_cast<std::size_t>(problem.n_uav()),
                                  static_cast<std::size_t>(problem.n_task())};
    return nb::ndarray<nb::numpy, const T, nb::ndim<2>>(first, 2, shape, owner);
}

}  // namespace

void bind_problem(nb::module_& module) {
    nb::class_<Problem>(module, "KernelProblem")
        .def(
            "__init__",
            [](Problem* self, const GivenTable& start_enu_m, const GivenTable& task_enu_m,
               const Given& speed_m_s, const Given& value, const Given& service_s,
               const GivenTable& success, const GivenTable& survival, double horizon_s,
               const std::optional<Given>& acceleration_m_s2) {
                new (self) Problem(checked(start_enu_m, task_enu_m, speed_m_s, value, service_s,
                                           success, survival, horizon_s, acceleration_m_s2));
            },
            nb::arg("start_enu_m").noconvert(), nb::arg("task_enu_m").noconvert(),
            nb::arg("speed_m_s").noconvert(), nb::arg("value").noconvert(),
            nb::arg("service_s").noconvert(), nb::arg("success").noconvert(),
            nb::arg("survival").noconvert(), nb::arg("horizon_s"),
            nb::arg("acceleration_m_s2").noconvert() = nb::none())
        .def_prop_ro("n_uav", &Problem::n_uav)
        .def_prop_ro("n_task", &Problem::n_task)
        .def_prop_ro("certain", &Problem::certain)
        .def_prop_ro("horizon_s", &Problem::horizon_s)
        .def_prop_ro("weight",
                     [](nb::handle self) {
                         const auto& problem = nb::cast<const Problem&>(self);
                         return view<double>(self, problem, problem.weights(0));
                     })
        .def_prop_ro("capable",
                     [](nb::handle self) {
                         const auto& problem = nb::cast<const Problem&>(self);
                         return view<bool>(self, problem, problem.abilities(0));
                     })
        .def_prop_ro("near", [](nb::handle self) {
            const auto& problem = nb::cast<const Problem&>(self);
            problem.lay_out();
            const std::size_t shape[2] = {static_cast<std::size_t>(problem.n_task()),
                                          static_cast<std::size_t>(problem.n_near())};
            return nb::ndarray<nb::numpy, const std::int32_t, nb::ndim<2>>(problem.near(0), 2,
                                                                           shape, self);
        });
}

}  // namespace peckorder
