// The field's problem as Python passes it, checked once; kernels take `const BoundField&`.
#pragma once

#include <cstdint>
#include <vector>

#include "arrays.hpp"
#include "field.hpp"

namespace peckorder {

// Keeps alive the arrays that `problem` points into, none of which is copied but the flags.
struct BoundField {
    In<std::int32_t, 1> kind;
    In<double, 3> leg_s;
    In<double, 3> line_s;
    In<std::int32_t, 2> enter;
    In<double, 2> home_s;
    In<std::int32_t, 2> home;
    In<double, 1> service_s, opens_s, closes_s, due_s;
    In<double, 2> weight, survival;
    In<double, 1> full_s, land_s, swap_s;
    In<std::int32_t, 1> slots;
    std::vector<double> until_s;                         // what follows from them
    std::vector<std::uint8_t> is_line, required, capable;
    FieldProblem problem{};

    BoundField() = default;
    BoundField(BoundField&&) = default;  // `problem` points to what then belongs to the new one
    BoundField(const BoundField&) = delete;
    BoundField& operator=(const BoundField&) = delete;
    BoundField& operator=(BoundField&&) = delete;
};

// Where a team stands as Python passes it (swarm.allocation.field.FieldState).
struct BoundFieldTeam {
    In<double, 1> free_s, sortie_end_s;
    In<double, 2> first_s;
    In<double, 1> survived;
    In<bool, 1> active, open;
    In<std::int32_t, 1> landed_at;
    In<std::int64_t, 1> rank;
    In<double, 1> arrives_s{};  // these three are left out where slots are no concern
    In<std::int32_t, 1> leaving{};
    In<double, 1> leaves_s{};

    // A view, once shapes and numbers are checked; legs only of who is to decide, if one is.
    FieldTeam checked(const FieldProblem& problem, int decider = -1) const;
};

}  // namespace peckorder
