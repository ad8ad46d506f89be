// Whether two paths stay apart in the slabs of air that both touch: what is asked of every way that
// is asked for, of each near it. Definitions: tests/support/paths_reference.py.

#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"

namespace peckorder {

namespace {

constexpr double kEndless = std::numeric_limits<double>::infinity();
constexpr double kLevelM = 1e-9;
constexpr int kMany = 2;  // slabs in common, beyond which paths are first seen as a whole

using Place = std::array<double, 2>;

struct Piece {
    Place begin, end;
};

using Pieces = std::vector<Piece>;
using Corners = In<double, 2>;

// What of a path is between two heights, seen from above.
Pieces flat_pieces(const Corners& path, double low_m, double high_m) {
    const std::size_t corners = path.shape(0);
    const double* first_corner = path.data();
    Pieces found;
    for (std::size_t k = 0; k < std::max<std::size_t>(corners, 2) - 1; ++k) {
        const double* begin = first_corner + 3 * k;
        const double* end = corners == 1 ? begin : begin + 3;
        const double rise = end[2] - begin[2];
        double first = 0.0, last = 1.0;
        if (std::abs(rise) < kLevelM) {
            if (!(begin[2] > low_m && begin[2] < high_m)) continue;
        } else {
            if (!(std::min(begin[2], end[2]) < high_m && std::max(begin[2], end[2]) > low_m)) {
                continue;
            }
            const double per_m = 1.0 / rise;
            const double at_low = (low_m - begin[2]) * per_m, at_high = (high_m - begin[2]) * per_m;
            first = std::clamp(std::min(at_low, at_high), 0.0, 1.0);
            last = std::clamp(std::max(at_low, at_high), 0.0, 1.0);
        }
        const Place way{end[0] - begin[0], end[1] - begin[1]};
        found.push_back({{begin[0] + first * way[0], begin[1] + first * way[1]},
                         {begin[0] + last * way[0], begin[1] + last * way[1]}});
    }
    return found;
}

// On which side of the line from a to b c is.
double side(const Place& a, const Place& b, const Place& c) {
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

bool cross(const Piece& one, const Piece& other) {
    return side(one.begin, one.end, other.begin) * side(one.begin, one.end, other.end) < 0.0 &&
           side(other.begin, other.end, one.begin) * side(other.begin, other.end, one.end) < 0.0;
}

double squared_from(const Place& place, const Piece& piece) {
    const Place way{piece.end[0] - piece.begin[0], piece.end[1] - piece.begin[1]};
    const double length2 = way[0] * way[0] + way[1] * way[1];
    const double along =
        ((place[0] - piece.begin[0]) * way[0] + (place[1] - piece.begin[1]) * way[1]) /
        (length2 > 0.0 ? length2 : 1.0);
    const double share = std::clamp(along, 0.0, 1.0);
    const double east = place[0] - (piece.begin[0] + share * way[0]);
    const double north = place[1] - (piece.begin[1] + share * way[1]);
    return east * east + north * north;
}

// Between any two of them; two that do not cross are nearest at one of their four ends.
double least_m(const Pieces& some, const Pieces& others) {
    double least = kEndless;
    for (const Piece& one : some) {
        for (const Piece& other : others) {
            if (cross(one, other)) return 0.0;
            least = std::min({least, squared_from(one.begin, other), squared_from(one.end, other),
                              squared_from(other.begin, one), squared_from(other.end, one)});
        }
    }
    return std::sqrt(least);
}

// First and last slab in whose reach any of a path is.
std::array<std::ptrdiff_t, 2> touched(const In<double, 1>& cuts, const Corners& path,
                                      double near_m) {
    double lowest = kEndless, highest = -kEndless;
    for (std::size_t k = 0; k < path.shape(0); ++k) {
        lowest = std::min(lowest, path.data()[3 * k + 2]);
        highest = std::max(highest, path.data()[3 * k + 2]);
    }
    const double* begin = cuts.data();
    const double* end = begin + cuts.size();
    const auto first = std::partition_point(
        begin, end, [=](double cut_m) { return !(lowest < cut_m + near_m); });
    const auto last = std::partition_point(
        begin, end, [=](double cut_m) { return cut_m - near_m < highest; });
    return {first - begin, last - begin};
}

bool paths_apart(const In<double, 1>& cuts_m, double near_m, double asked_m, const Corners& one,
                 const Corners& other, const std::optional<std::vector<int>>& within) {
    require_shape("one_m", one, {one.shape(0), 3});
    require_shape("other_m", other, {other.shape(0), 3});
    require_finite("cuts_m", cuts_m.data(), cuts_m.size());
    require_finite("one_m", one.data(), one.size());
    require_finite("other_m", other.data(), other.size());
    if (one.shape(0) == 0 || other.shape(0) == 0) return true;
    const auto mine = touched(cuts_m, one, near_m), its = touched(cuts_m, other, near_m);
    const std::ptrdiff_t first = std::max(mine[0], its[0]), last = std::min(mine[1], its[1]);
    if (last - first + 1 > kMany &&
        least_m(flat_pieces(one, -kEndless, kEndless), flat_pieces(other, -kEndless, kEndless)) >=
            asked_m) {
        return true;
    }
    const auto cuts = static_cast<std::ptrdiff_t>(cuts_m.size());
    for (std::ptrdiff_t slab = first; slab <= last; ++slab) {
        if (within && std::find(within->begin(), within->end(), slab) == within->end()) continue;
        const double low_m = slab > 0 ? cuts_m.data()[slab - 1] - near_m : -kEndless;
        const double high_m = slab < cuts ? cuts_m.data()[slab] + near_m : kEndless;
        const Pieces some = flat_pieces(one, low_m, high_m);
        const Pieces others = flat_pieces(other, low_m, high_m);
        if (least_m(some, others) < asked_m) return false;  // of none it is endless
    }
    return true;
}

}  // namespace

void bind_paths(nb::module_& module) {
    module.def("paths_apart", &paths_apart, nb::arg("cuts_m"), nb::arg("near_m"),
               nb::arg("asked_m"), nb::arg("one_m"), nb::arg("other_m"),
               nb::arg("within").none());
}

}  // namespace peckorder
