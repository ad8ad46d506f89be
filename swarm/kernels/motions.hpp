// Motions of the next seconds, sampled, and how near they come; see motions.py.
#pragma once

#include <array>
#include <cstddef>
#include <utility>
#include <vector>

namespace peckorder {

using Vector = std::array<double, 3>;

double length(const Vector& v);

// How a UAV flies: where it is, how it moves, what corners are ahead, and at which speed.
struct Flight {
    Vector place;
    Vector velocity;
    std::vector<Vector> path;
    double speed;
};

// Places at 0, step_s, …, steps * step_s, coordinates in a row; it brakes after drive_s.
std::vector<double> sampled(const Flight& flight, double acceleration, double climb, double drive_s,
                            double step_s, int steps);

// Squared distance and, in samples from the first, the moment at which two motions are nearest.
std::pair<double, double> nearest(const double* some, const double* others, std::size_t samples);

// Squared, between any of some places and any of others, which may be so far beside, flat and
// upright.
double least_squared(const double* some, std::size_t count, const double* others,
                     std::size_t other_count, double flat_m, double upright_m);

}  // namespace peckorder
