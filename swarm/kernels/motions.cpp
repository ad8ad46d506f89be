// How UAVs move in the next seconds, and how near they come: what each decides by several times a
// second for each one near it. Definitions: tests/support/motions_reference.py.

#include <nanobind/stl/array.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <tuple>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "motions.hpp"

namespace peckorder {

double length(const Vector& v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

namespace {

constexpr double kReachedM = 0.5;
constexpr double kHereM = 1e-6;
constexpr double kLevelM = 1e-6;
constexpr int kMostSteps = 100000;  // hours

Vector between(const Vector& from, const Vector& to) {
    return {to[0] - from[0], to[1] - from[1], to[2] - from[2]};
}

struct Motion {
    Vector place;
    Vector velocity;
    std::size_t corner = 0;

    // The velocity it would have at once if it could, on its way through `path`.
    Vector wanted(const std::vector<Vector>& path, double speed, double acceleration, double climb,
                  double step_s) {
        const std::size_t last = path.size() - 1;
        Vector away = between(place, path[corner]);
        double away_m = length(away);
        const double near_m = std::max(kReachedM, step_s * length(velocity));
        while (corner < last && away_m <= near_m) {
            away = between(place, path[++corner]);
            away_m = length(away);
        }
        if (!(away_m > kHereM)) return {0.0, 0.0, 0.0};
        double pace = speed;
        if (corner == last) {
            pace = std::min({pace, std::sqrt(2.0 * acceleration * away_m), away_m / step_s});
        }
        const double steep_m = std::abs(away[2]);
        if (steep_m > kLevelM) pace = std::min(pace, climb * away_m / steep_m);
        const double share = pace / away_m;
        return {share * away[0], share * away[1], share * away[2]};
    }

    void advance(const Vector& wanted, double change, double step_s) {
        Vector add = between(velocity, wanted);
        const double much = length(add);
        const double share = much > change ? change / much : 1.0;
        for (int axis = 0; axis < 3; ++axis) {
            add[axis] *= share;
            // The mean of the speeds before and after, as it changes evenly.
            place[axis] += step_s * (velocity[axis] + 0.5 * add[axis]);
            velocity[axis] += add[axis];
        }
    }
};

}  // namespace

std::vector<double> sampled(const Flight& flight, double acceleration, double climb, double drive_s,
                            double step_s, int steps) {
    std::vector<double> places;
    places.reserve(3 * (static_cast<std::size_t>(steps) + 1));
    Motion motion{flight.place, flight.velocity};
    places.insert(places.end(), motion.place.begin(), motion.place.end());
    for (int step = 0; step < steps; ++step) {
        const bool drives = !flight.path.empty() && step * step_s < drive_s;
        const Vector wanted =
            drives ? motion.wanted(flight.path, flight.speed, acceleration, climb, step_s)
                   : Vector{0.0, 0.0, 0.0};
        motion.advance(wanted, acceleration * step_s, step_s);
        places.insert(places.end(), motion.place.begin(), motion.place.end());
    }
    return places;
}

std::pair<double, double> nearest(const double* some, const double* others, std::size_t samples) {
    double least = std::numeric_limits<double>::infinity(), when = 0.0;
    for (std::size_t k = 0; k + 1 < samples; ++k) {
        double apart[3], change[3], length2 = 0.0, towards = 0.0, square = 0.0;
        for (int axis = 0; axis < 3; ++axis) {
            apart[axis] = some[3 * k + axis] - others[3 * k + axis];
            change[axis] = (some[3 * (k + 1) + axis] - others[3 * (k + 1) + axis]) - apart[axis];
            length2 += change[axis] * change[axis];
            towards -= apart[axis] * change[axis];
        }
        const double share = std::clamp(towards / std::max(length2, 1e-12), 0.0, 1.0);
        for (int axis = 0; axis < 3; ++axis) {
            const double at = apart[axis] + share * change[axis];
            square += at * at;
        }
        if (square < least) {
            least = square;
            when = static_cast<double>(k) + share;
        }
    }
    return {least, when};
}

double least_squared(const double* some, std::size_t count, const double* others,
                     std::size_t other_count, double flat_m, double upright_m) {
    double least = std::numeric_limits<double>::infinity();
    for (const double* one = some; one != some + 3 * count; one += 3) {
        for (const double* it = others; it != others + 3 * other_count; it += 3) {
            const double east = one[0] - it[0], north = one[1] - it[1], up = one[2] - it[2];
            double flat2 = east * east + north * north, upright2 = up * up;
            if (flat_m > 0.0) {
                const double flat = std::max(0.0, std::sqrt(flat2) - flat_m);
                flat2 = flat * flat;
            }
            if (upright_m > 0.0) {
                const double upright = std::max(0.0, std::abs(up) - upright_m);
                upright2 = upright * upright;
            }
            least = std::min(least, flat2 + upright2);
        }
    }
    return least;
}

namespace {

Out<double, 2> sampled_motion(const Vector& position_m, const Vector& velocity_m_s,
                              const std::vector<Vector>& path_m, double speed_m_s,
                              double acceleration_m_s2, double climb_m_s, double drive_s,
                              double step_s, int steps) {
    require_finite("position_m", position_m.data(), 3);
    require_finite("velocity_m_s", velocity_m_s.data(), 3);
    for (const Vector& corner : path_m) require_finite("path_m", corner.data(), 3);
    require_within("step_s", step_s, std::numeric_limits<double>::min(), 1e9, "positive");
    require_within("steps", steps, 0, kMostSteps, "between 0 and 100000");
    auto places = sampled({position_m, velocity_m_s, path_m, speed_m_s}, acceleration_m_s2,
                          climb_m_s, drive_s, step_s, steps);
    const std::size_t shape[2] = {places.size() / 3, 3};
    return give<double, 2>(std::move(places), shape);
}

void require_samples(const In<double, 3>& some, const In<double, 3>& others) {
    require_shape("others_m", others, {some.shape(0), some.shape(1), 3});
    require_shape("some_m", some, {some.shape(0), some.shape(1), 3});
    if (some.shape(1) < 2) refuse("some_m must have two samples or more");
    require_finite("some_m", some.data(), some.size());
    require_finite("others_m", others.data(), others.size());
}

std::tuple<Out<double, 1>, Out<double, 1>> meetings(const In<double, 3>& some,
                                                    const In<double, 3>& others) {
    require_samples(some, others);
    const std::size_t pairs = some.shape(0), samples = some.shape(1);
    std::vector<double> distance_m(pairs), when(pairs);
    for (std::size_t k = 0; k < pairs; ++k) {
        const std::size_t first = 3 * k * samples;
        const auto [square, at] = nearest(some.data() + first, others.data() + first, samples);
        distance_m[k] = std::sqrt(square);
        when[k] = at;
    }
    return {give(std::move(distance_m)), give(std::move(when))};
}

double least_distance_m(const In<double, 2>& some, const In<double, 2>& others, double flat_m,
                        double upright_m) {
    require_shape("some_m", some, {some.shape(0), 3});
    require_shape("others_m", others, {others.shape(0), 3});
    if (some.shape(0) == 0 || others.shape(0) == 0) refuse("places must not be none");
    require_finite("some_m", some.data(), some.size());
    require_finite("others_m", others.data(), others.size());
    require_within("stray_m", flat_m, 0.0, std::numeric_limits<double>::max(), ">= 0");
    require_within("stray_m", upright_m, 0.0, std::numeric_limits<double>::max(), ">= 0");
    return std::sqrt(least_squared(some.data(), some.shape(0), others.data(), others.shape(0), flat_m,
                                   upright_m));
}

}  // namespace

void bind_motions(nb::module_& module) {
    module.def("sampled_motion", &sampled_motion, nb::arg("position_m"), nb::arg("velocity_m_s"),
               nb::arg("path_m"), nb::arg("speed_m_s"), nb::arg("acceleration_m_s2"),
               nb::arg("climb_m_s"), nb::arg("drive_s"), nb::arg("step_s"), nb::arg("steps"));
    module.def("meetings", &meetings, nb::arg("some_m"), nb::arg("others_m"));
    module.def("least_distance_m", &least_distance_m, nb::arg("some_m"), nb::arg("others_m"),
               nb::arg("flat_m"), nb::arg("upright_m"));
}

}  // namespace peckorder
