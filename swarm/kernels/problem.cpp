// The prepared mission and its checks; see problem.hpp.
#include "problem.hpp"

#include <algorithm>
#include <limits>

#include "arrays.hpp"
#include "bindings.hpp"
#include "rules.hpp"

namespace peckorder {

Problem::Problem() = default;
Problem::~Problem() = default;

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

void bind_problem(nb::module_& module) {
    nb::class_<Problem>(module, "KernelProblem")
        .def(
            "__init__",
            [](Problem* self, In<double, 2> start_enu_m, In<double, 2> task_enu_m,
               In<double, 1> speed_m_s, In<double, 1> service_s, In<double, 2> weight,
               In<bool, 2> capable, In<double, 2> survival, double horizon_s) {
                const std::size_t n_uav = speed_m_s.shape(0), n_task = service_s.shape(0);
                const std::size_t cells = n_uav * n_task;
                if (n_uav > 100'000 || n_task > 1'000'000) refuse("speed_m_s or service_s is too long");
                require_shape("start_enu_m", start_enu_m, {n_uav, 3});
                require_shape("task_enu_m", task_enu_m, {n_task, 3});
                require_shape("weight", weight, {n_uav, n_task});
                require_shape("capable", capable, {n_uav, n_task});
                require_shape("survival", survival, {n_uav, n_task});
                require_finite("start_enu_m", start_enu_m.data(), 3 * n_uav);
                require_finite("task_enu_m", task_enu_m.data(), 3 * n_task);
                const double most = std::numeric_limits<double>::max();
                for (std::size_t i = 0; i < n_uav; ++i) {
                    require_within("speed_m_s", speed_m_s.data()[i],
                                   std::numeric_limits<double>::denorm_min(), most,
                                   "> 0 and finite");
                }
                for (std::size_t i = 0; i < n_task; ++i) {
                    require_within("service_s", service_s.data()[i], 0.0, most, ">= 0 and finite");
                }
                for (std::size_t i = 0; i < cells; ++i) {
                    require_within("weight", weight.data()[i], 0.0, most, ">= 0 and finite");
                    require_within("survival", survival.data()[i], 0.0, 1.0, "within 0..1");
                }
                require_within("horizon_s", horizon_s, std::numeric_limits<double>::denorm_min(),
                               most, "> 0 and finite");

                new (self) Problem();
                self->n_uav = static_cast<int>(n_uav);
                self->n_task = static_cast<int>(n_task);
                self->horizon_s = horizon_s;
                self->start_m.assign(start_enu_m.data(), start_enu_m.data() + 3 * n_uav);
                self->speed_m_s.assign(speed_m_s.data(), speed_m_s.data() + n_uav);
                self->service_s.assign(service_s.data(), service_s.data() + n_task);
                self->weight.assign(weight.data(), weight.data() + cells);
                self->survival.assign(survival.data(), survival.data() + cells);
                for (std::size_t i = 0; i < n_task; ++i) {
                    self->x_m.push_back(task_enu_m.data()[3 * i]);
                    self->y_m.push_back(task_enu_m.data()[3 * i + 1]);
                    self->z_m.push_back(task_enu_m.data()[3 * i + 2]);
                }
                const auto* bytes = reinterpret_cast<const std::uint8_t*>(capable.data());
                for (std::size_t i = 0; i < cells; ++i) self->capable.push_back(bytes[i] != 0);
                for (std::size_t i = 0; i < n_uav; ++i) {
                    const auto row = self->capable.begin() + static_cast<std::ptrdiff_t>(i * n_task);
                    const auto end = row + static_cast<std::ptrdiff_t>(n_task);
                    self->capable_of_all.push_back(std::find(row, end, 0) == end);
                }
            },
            nb::arg("start_enu_m").noconvert(), nb::arg("task_enu_m").noconvert(), nb::arg("speed_m_s").noconvert(),
            nb::arg("service_s").noconvert(), nb::arg("weight").noconvert(), nb::arg("capable").noconvert(), nb::arg("survival").noconvert(),
            nb::arg("horizon_s"))
        .def_prop_ro("n_uav", [](const Problem& self) { return self.n_uav; })
        .def_prop_ro("n_task", [](const Problem& self) { return self.n_task; });
}

}  // namespace peckorder
