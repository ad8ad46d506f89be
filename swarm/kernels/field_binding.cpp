// The field's problem and the states of its teams come in from Python; see field_binding.hpp.
#include "field_binding.hpp"

#include <cstddef>
#include <limits>
#include <utility>

#include "bindings.hpp"

namespace peckorder {

namespace {

using Size = std::size_t;

constexpr double kEndless = std::numeric_limits<double>::infinity();
constexpr double kMost = std::numeric_limits<double>::max();
constexpr double kLeast = std::numeric_limits<double>::denorm_min();
constexpr std::int32_t kMostSlots = std::numeric_limits<std::int32_t>::max();

template <typename Array, typename T>
void require_numbers(const char* name, const Array& array, T low, T high, const char* range) {
    bool right = true;  // without a way out, which would keep the loop from being vectorised
    for (Size i = 0; i < array.size(); ++i) {
        right &= (array.data()[i] >= low) & (array.data()[i] <= high);
    }
    for (Size i = 0; !right && i < array.size(); ++i) {
        require_within(name, static_cast<double>(array.data()[i]), static_cast<double>(low),
                       static_cast<double>(high), range);
    }
}

void require_shapes(const BoundField& given) {
    const Size n_uav = given.full_s.shape(0), n_base = given.swap_s.shape(0);
    const Size n_task = given.service_s.shape(0), n_kind = given.leg_s.shape(0);
    const Size n_node = given.leg_s.shape(1);
    if (n_uav > 100'000 || n_base > 100'000 || n_task > 1'000'000 || n_node > 2'200'000) {
        refuse("there are too many UAVs, bases, tasks or nodes");
    }
    if (n_node < n_uav + n_base) refuse("leg_s must have a node for every UAV and base");
    require_shape("kind", given.kind, {n_uav});
    require_shape("leg_s", given.leg_s, {n_kind, n_node, n_node});
    require_shape("line_s", given.line_s, {n_kind, n_task, 2});
    require_shape("enter", given.enter, {n_task, 2});
    require_shape("home_s", given.home_s, {n_uav, n_node});
    require_shape("home", given.home, {n_uav, n_node});
    require_shape("opens_s", given.opens_s, {n_task});
    require_shape("closes_s", given.closes_s, {n_task});
    require_shape("due_s", given.due_s, {n_task});
    require_shape("weight", given.weight, {n_uav, n_task});
    require_shape("survival", given.survival, {n_uav, n_task});
    require_shape("land_s", given.land_s, {n_uav});
    require_shape("slots", given.slots, {n_base});
}

void require_right(const BoundField& given, const In<bool, 2>& capable, double horizon_s) {
    require_shapes(given);
    require_shape("capable", capable, {given.full_s.shape(0), given.service_s.shape(0)});
    const auto last = [](Size count) { return static_cast<std::int32_t>(count) - 1; };
    const char* const indices = "indices of what there is";
    const char* const times = ">= 0, or infinite";
    require_numbers("kind", given.kind, 0, last(given.leg_s.shape(0)), indices);
    require_numbers("leg_s", given.leg_s, 0.0, kEndless, times);
    require_numbers("line_s", given.line_s, 0.0, kEndless, times);
    require_numbers("enter", given.enter, 0, last(given.leg_s.shape(1)), indices);
    require_numbers("home_s", given.home_s, 0.0, kEndless, times);
    require_numbers("home", given.home, -1, last(given.swap_s.shape(0)), indices);
    require_numbers("service_s", given.service_s, 0.0, kMost, ">= 0 and finite");
    require_numbers("opens_s", given.opens_s, 0.0, kMost, ">= 0 and finite");
    require_numbers("closes_s", given.closes_s, 0.0, kEndless, times);
    require_numbers("due_s", given.due_s, 0.0, kEndless, times);
    require_numbers("weight", given.weight, 0.0, kMost, ">= 0 and finite");
    require_numbers("survival", given.survival, 0.0, 1.0, "within 0..1");
    require_numbers("full_s", given.full_s, 0.0, kEndless, times);
    require_numbers("land_s", given.land_s, 0.0, kMost, ">= 0 and finite");
    require_numbers("swap_s", given.swap_s, 0.0, kMost, ">= 0 and finite");
    require_numbers("slots", given.slots, 0, kMostSlots, ">= 0");
    require_within("horizon_s", horizon_s, kLeast, kMost, "> 0 and finite");
}

// What C++ reads of booleans that were arrays of NumPy, which may hold other bytes than 0 and 1.
std::vector<std::uint8_t> flags_of(const In<bool, 2>& array) {
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(array.data());
    std::vector<std::uint8_t> flags(bytes, bytes + array.size());
    for (std::uint8_t& flag : flags) flag = flag != 0;
    return flags;
}

void prepare(BoundField& given, double horizon_s) {
    const Size n_task = given.service_s.shape(0);
    for (Size task = 0; task < n_task; ++task) {
        const double due_s = given.due_s.data()[task];
        const bool required = due_s == kEndless;
        given.required.push_back(required);
        given.until_s.push_back(required ? horizon_s : due_s);
        given.is_line.push_back(given.enter.data()[2 * task] != given.enter.data()[2 * task + 1]);
    }
    FieldProblem& problem = given.problem;
    problem.n_uav = static_cast<int>(given.full_s.shape(0));
    problem.n_base = static_cast<int>(given.swap_s.shape(0));
    problem.n_task = static_cast<int>(n_task);
    problem.n_node = static_cast<int>(given.leg_s.shape(1));
    problem.n_kind = static_cast<int>(given.leg_s.shape(0));
    problem.horizon_s = horizon_s;
    problem.kind = given.kind.data();
    problem.leg_s = given.leg_s.data();
    problem.line_s = given.line_s.data();
    problem.enter = given.enter.data();
    problem.home_s = given.home_s.data();
    problem.home = given.home.data();
    problem.is_line = given.is_line.data();
    problem.service_s = given.service_s.data();
    problem.opens_s = given.opens_s.data();
    problem.closes_s = given.closes_s.data();
    problem.due_s = given.due_s.data();
    problem.until_s = given.until_s.data();
    problem.required = given.required.data();
    problem.weight = given.weight.data();
    problem.survival = given.survival.data();
    problem.capable = given.capable.data();
    problem.full_s = given.full_s.data();
    problem.land_s = given.land_s.data();
    problem.swap_s = given.swap_s.data();
    problem.slots = given.slots.data();
}

template <typename T>
nb::ndarray<nb::numpy, const T, nb::ndim<1>> view(nb::handle owner, const void* first,
                                                  Size count) {
    return nb::ndarray<nb::numpy, const T, nb::ndim<1>>(first, {count}, owner);
}

}  // namespace

FieldTeam BoundFieldTeam::checked(const FieldProblem& problem, int decider) const {
    const Size n_uav = static_cast<Size>(problem.n_uav);
    require_shape("free_s", free_s, {n_uav});
    require_shape("sortie_end_s", sortie_end_s, {n_uav});
    require_shape("first_s", first_s, {n_uav, static_cast<Size>(problem.n_node)});
    require_shape("survived", survived, {n_uav});
    require_shape("active", active, {n_uav});
    require_shape("open", open, {static_cast<Size>(problem.n_task)});
    require_shape("landed_at", landed_at, {n_uav});
    require_shape("rank", rank, {n_uav});
    require_numbers("free_s", free_s, -kMost, kEndless, "times, not NaN or -infinity");
    require_numbers("sortie_end_s", sortie_end_s, -kEndless, kEndless, "times, not NaN");
    if (decider < 0) {
        require_numbers("first_s", first_s, 0.0, kEndless, ">= 0, or infinite");
    } else {
        const Size n_node = first_s.shape(1);
        const double* row = first_s.data() + static_cast<Size>(decider) * n_node;
        for (Size node = 0; node < n_node; ++node) {
            require_within("first_s", row[node], 0.0, kEndless, ">= 0, or infinite");
        }
    }
    require_numbers("survived", survived, 0.0, 1.0, "within 0..1");
    const char* const bases = "indices of bases, or -1";
    require_numbers("landed_at", landed_at, -1, problem.n_base - 1, bases);
    FieldTeam team{free_s.data(),    sortie_end_s.data(), first_s.data(),   survived.data(),
                   bytes_of(active), bytes_of(open),      landed_at.data(), rank.data()};
    if (arrives_s.data() == nullptr) return team;
    require_shape("arrives_s", arrives_s, {n_uav});
    require_shape("leaving", leaving, {n_uav});
    require_shape("leaves_s", leaves_s, {n_uav});
    require_numbers("arrives_s", arrives_s, -kEndless, kEndless, "times, not NaN");
    require_numbers("leaving", leaving, -1, problem.n_base - 1, bases);
    require_numbers("leaves_s", leaves_s, -kMost, kMost, "finite times");
    team.arrives_s = arrives_s.data();
    team.leaving = leaving.data();
    team.leaves_s = leaves_s.data();
    return team;
}

void bind_field(nb::module_& module) {
    nb::class_<BoundField>(module, "KernelField")
        .def(
            "__init__",
            [](BoundField* self, In<std::int32_t, 1> kind, In<double, 3> leg_s,
               In<double, 3> line_s, In<std::int32_t, 2> enter, In<double, 2> home_s,
               In<std::int32_t, 2> home, In<double, 1> service_s, In<double, 1> opens_s,
               In<double, 1> closes_s, In<double, 1> due_s, In<double, 2> weight,
               In<double, 2> survival, In<bool, 2> capable, In<double, 1> full_s,
               In<double, 1> land_s, In<double, 1> swap_s, In<std::int32_t, 1> slots,
               double horizon_s) {
                BoundField given;
                given.kind = kind;
                given.leg_s = leg_s;
                given.line_s = line_s;
                given.enter = enter;
                given.home_s = home_s;
                given.home = home;
                given.service_s = service_s;
                given.opens_s = opens_s;
                given.closes_s = closes_s;
                given.due_s = due_s;
                given.weight = weight;
                given.survival = survival;
                given.full_s = full_s;
                given.land_s = land_s;
                given.swap_s = swap_s;
                given.slots = slots;
                require_right(given, capable, horizon_s);
                given.capable = flags_of(capable);
                prepare(given, horizon_s);
                new (self) BoundField(std::move(given));
            },
            nb::arg("kind").noconvert(), nb::arg("leg_s").noconvert(),
            nb::arg("line_s").noconvert(), nb::arg("enter").noconvert(),
            nb::arg("home_s").noconvert(), nb::arg("home").noconvert(),
            nb::arg("service_s").noconvert(), nb::arg("opens_s").noconvert(),
            nb::arg("closes_s").noconvert(), nb::arg("due_s").noconvert(),
            nb::arg("weight").noconvert(), nb::arg("survival").noconvert(),
            nb::arg("capable").noconvert(), nb::arg("full_s").noconvert(),
            nb::arg("land_s").noconvert(), nb::arg("swap_s").noconvert(),
            nb::arg("slots").noconvert(), nb::arg("horizon_s"))
        .def_prop_ro("until_s",
                     [](nb::handle self) {
                         const auto& given = nb::cast<const BoundField&>(self);
                         return view<double>(self, given.until_s.data(), given.until_s.size());
                     })
        .def_prop_ro("required",
                     [](nb::handle self) {
                         const auto& given = nb::cast<const BoundField&>(self);
                         return view<bool>(self, given.required.data(), given.required.size());
                     })
        .def_prop_ro("is_line", [](nb::handle self) {
            const auto& given = nb::cast<const BoundField&>(self);
            return view<bool>(self, given.is_line.data(), given.is_line.size());
        });
}

}  // namespace peckorder
