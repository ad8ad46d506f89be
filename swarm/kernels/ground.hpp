// The ground as a grid of heights, and paths over it.
#pragma once

#include <cstddef>
#include <vector>

namespace peckorder {

// Heights on a grid, bilinear in its cells; beyond its edges as high as at the nearest edge.
struct Ground {
    const double* up_m;  // (rows, columns), from south to north, from west to east
    int rows, columns;   // two or more of each
    double west_m, south_m;
    double east_step_m, north_step_m;

    double up(double east_m, double north_m) const;
};

struct GroundPoint {
    double east_m, north_m, up_m;
};

// What a path keeps above the ground at its two ends, and evenly changing in between.
struct Room {
    double begin_m, end_m;
};

// How much higher than the shortest a path over the ground may be, to have few corners.
constexpr double kFewerCornersM = 1.0;

// Appends the shortest path over the ground along a horizontal one of n >= 2 places (n, 2), from
// begin_up_m to end_up_m, with corners wherever the horizontal one has them, to `path`.
void drape(const Ground& ground, const double* place_m, int n, double begin_up_m, double end_up_m,
           Room room, std::vector<GroundPoint>& path);

}  // namespace peckorder
