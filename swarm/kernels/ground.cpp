#include "ground.hpp"

#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "arrays.hpp"
#include "bindings.hpp"

namespace peckorder {

namespace {

constexpr double kSameM = 1e-6;  // heights that differ by less are the same
constexpr double kAboveM = 0.05;  // what keeps a path from the ground is that far above it at most

// A place along a path: how far it is, and how high.
struct Mark {
    double along_m, up_m;
};

// One cell that a straight piece crosses.
struct Cell {
    double low_u, low_v;      // its corner, in steps
    double u0, u1, v0, v1;    // its four heights: south-west, south-east, north-west, north-east
    double at(double u, double v) const {
        const double x = u - low_u, y = v - low_v;
        const double south = u0 + x * (u1 - u0), north = v0 + x * (v1 - v0);
        return south + y * (north - south);
    }
    double twist() const { return v1 - v0 - u1 + u0; }
};

double within(double value, double most) { return std::min(std::max(value, 0.0), most); }

Cell cell_at(const Ground& ground, double u, double v) {
    const int column = std::min(static_cast<int>(u), ground.columns - 2);
    const int row = std::min(static_cast<int>(v), ground.rows - 2);
    const double* at = ground.up_m + static_cast<std::size_t>(row) * ground.columns + column;
    return {double(column), double(row), at[0], at[1], at[ground.columns], at[ground.columns + 1]};
}

double height_above(const Mark& mark, const Mark& from, const Mark& to) {
    const double length_m = to.along_m - from.along_m;
    if (!(length_m > 0.0)) return mark.up_m - std::max(from.up_m, to.up_m);
    const double share = (mark.along_m - from.along_m) / length_m;
    return mark.up_m - (from.up_m + share * (to.up_m - from.up_m));
}

// Height of a chain of marks there; of a jump the upper end.
double height_on(const std::vector<Mark>& chain, double along_m) {
    const auto later = std::upper_bound(chain.begin(), chain.end(), along_m,
                                        [](double a, const Mark& mark) { return a < mark.along_m; });
    if (later == chain.begin()) return chain.front().up_m;
    if (later == chain.end()) return chain.back().up_m;
    const Mark &from = *(later - 1), &to = *later;
    const double share = (along_m - from.along_m) / (to.along_m - from.along_m);
    return from.up_m + share * (to.up_m - from.up_m);
}

// The ground under a path, as marks whose hull from above lies nowhere below it.
class Profile {
 public:
    Profile(const Ground& ground, Room room, double length_m)
        : ground_(ground), room_(room), length_m_(length_m) {}

    std::vector<Mark> marks;

    void add_piece(const double* from_m, const double* to_m, double begin_m, double piece_m) {
        const double u0 = (from_m[0] - ground_.west_m) / ground_.east_step_m;
        const double v0 = (from_m[1] - ground_.south_m) / ground_.north_step_m;
        const double du = (to_m[0] - from_m[0]) / ground_.east_step_m;
        const double dv = (to_m[1] - from_m[1]) / ground_.north_step_m;
        shares_.assign({0.0, 1.0});
        cross(u0, du, ground_.columns - 1);
        cross(v0, dv, ground_.rows - 1);
        std::sort(shares_.begin(), shares_.end());
        const double most_u = ground_.columns - 1, most_v = ground_.rows - 1;
        for (std::size_t k = 0; k + 1 < shares_.size(); ++k) {
            const double a = shares_[k], b = shares_[k + 1], middle = (a + b) / 2.0;
            if (!(b > a)) continue;
            const double u = u0 + middle * du, v = v0 + middle * dv;
            const Cell cell = cell_at(ground_, within(u, most_u), within(v, most_v));
            const auto up_at = [&](double share) {
                return cell.at(within(u0 + share * du, most_u), within(v0 + share * dv, most_v));
            };
            // A straight line across a bilinear cell is a parabola, under the hull of its ends and
            // of the point where its tangents meet; in parts, that point is not far above it.
            // Beyond the edges it is straight.
            const bool inside = u == within(u, most_u) && v == within(v, most_v);
            const double bend = inside ? cell.twist() * du * dv * (b - a) * (b - a) : 0.0;
            const int parts = bend < 0.0 ? int(std::ceil(std::sqrt(-bend / (4.0 * kAboveM)))) : 1;
            double here = a, from = up_at(a);
            add(begin_m + a * piece_m, from);
            for (int part = 1; part <= parts; ++part) {
                const double there = part == parts ? b : a + (b - a) * part / parts;
                const double to = up_at(there), part_bend = bend / (double(parts) * parts);
                if (bend < 0.0) {
                    const double meet = (here + there) / 2.0;
                    add(begin_m + meet * piece_m, (from + to - part_bend) / 2.0);
                }
                add(begin_m + there * piece_m, to);
                here = there;
                from = to;
            }
        }
    }

 private:
    const Ground& ground_;
    Room room_;
    double length_m_;
    std::vector<double> shares_;

    void cross(double from, double by, int last) {
        if (by == 0.0) return;
        const double low = std::max(0.0, std::ceil(std::min(from, from + by)));
        const double high = std::min(double(last), std::floor(std::max(from, from + by)));
        for (double line = low; line <= high; line += 1.0) {
            const double share = (line - from) / by;
            if (share > 0.0 && share < 1.0) shares_.push_back(share);
        }
    }

    void add(double along_m, double up_m) {
        const double share = std::min(1.0, along_m / length_m_);
        marks.push_back({along_m, up_m + room_.begin_m + share * (room_.end_m - room_.begin_m)});
    }
};

// The hull from above of marks in order, from the first to the last of them.
std::vector<Mark> hull_of(const std::vector<Mark>& marks) {
    std::vector<Mark> hull;
    for (const Mark& mark : marks) {
        while (hull.size() > 1 &&
               height_above(hull.back(), hull[hull.size() - 2], mark) <= kSameM) {
            hull.pop_back();
        }
        hull.push_back(mark);
    }
    return hull;
}

// A chain with fewer corners that lies above that hull, by kFewerCornersM at most: edges between
// others go, and those on both sides of each go on until they meet.
std::vector<Mark> simpler(const std::vector<Mark>& hull) {
    std::vector<Mark> chain;
    const auto slope = [](const Mark& a, const Mark& b) {
        return (b.up_m - a.up_m) / (b.along_m - a.along_m);
    };
    for (std::size_t next = 0; next < hull.size(); ++next) {
        chain.push_back(hull[next]);
        while (chain.size() >= 4) {
            const std::size_t n = chain.size();
            const Mark &a = chain[n - 4], &b = chain[n - 3], &c = chain[n - 2], &d = chain[n - 1];
            if (!(b.along_m > a.along_m && d.along_m > c.along_m)) break;
            const double rises = slope(a, b), falls = slope(c, d);
            if (!(rises > falls)) break;
            const double along_m =
                b.along_m + (c.up_m - b.up_m - falls * (c.along_m - b.along_m)) / (rises - falls);
            if (!(along_m >= b.along_m && along_m <= c.along_m)) break;
            const Mark met{along_m, b.up_m + rises * (along_m - b.along_m)};
            if (met.up_m - height_on(hull, along_m) > kFewerCornersM) break;
            const Mark last = d;
            chain.resize(n - 3);
            chain.push_back(met);
            chain.push_back(last);
        }
    }
    return chain;
}

}  // namespace

double Ground::up(double east_m, double north_m) const {
    const double u = within((east_m - west_m) / east_step_m, columns - 1);
    const double v = within((north_m - south_m) / north_step_m, rows - 1);
    return cell_at(*this, u, v).at(u, v);
}

void drape(const Ground& ground, const double* place_m, int n, double begin_up_m, double end_up_m,
           Room room, std::vector<GroundPoint>& path) {
    std::vector<double> along_m(n, 0.0);
    for (int k = 1; k < n; ++k) {
        const double* at = place_m + 2 * std::size_t(k);
        along_m[k] = along_m[k - 1] + std::hypot(at[0] - at[-2], at[1] - at[-1]);
    }
    const double length_m = along_m.back();
    const Mark begin{0.0, begin_up_m}, end{length_m, end_up_m};
    std::vector<Mark> chain{begin, end};
    if (length_m > 0.0) {
        Profile profile(ground, room, length_m);
        profile.marks.push_back(begin);
        for (int k = 1; k < n; ++k) {
            const double piece_m = along_m[k] - along_m[k - 1];
            const double* to = place_m + 2 * std::size_t(k);
            if (piece_m > 0.0) profile.add_piece(to - 2, to, along_m[k - 1], piece_m);
        }
        profile.marks.push_back(end);
        chain = simpler(hull_of(profile.marks));
    }
    int corner = 1;
    const auto place_at = [&](double at_m) {
        if (at_m <= kSameM) return GroundPoint{place_m[0], place_m[1], 0.0};
        if (at_m >= length_m - kSameM) {
            const double* last = place_m + 2 * std::size_t(n - 1);
            return GroundPoint{last[0], last[1], 0.0};
        }
        while (corner + 1 < n && along_m[corner] < at_m) ++corner;
        const double piece_m = along_m[corner] - along_m[corner - 1];
        const double share = piece_m > 0.0 ? (at_m - along_m[corner - 1]) / piece_m : 0.0;
        const double* to = place_m + 2 * std::size_t(corner);
        return GroundPoint{to[-2] + share * (to[0] - to[-2]), to[-1] + share * (to[1] - to[-1]),
                           0.0};
    };
    path.push_back({place_m[0], place_m[1], begin_up_m});
    int next = 1;  // corner of the horizontal path
    for (std::size_t k = 1; k + 1 < chain.size(); ++k) {
        const Mark& mark = chain[k];
        for (; next + 1 < n && along_m[next] < mark.along_m - kSameM; ++next) {
            const double* at = place_m + 2 * std::size_t(next);
            path.push_back({at[0], at[1], height_on(chain, along_m[next])});
        }
        GroundPoint point = place_at(mark.along_m);
        if (next + 1 < n && along_m[next] <= mark.along_m + kSameM) {
            const double* at = place_m + 2 * std::size_t(next++);
            point = {at[0], at[1], 0.0};
        }
        point.up_m = mark.up_m;
        path.push_back(point);
    }
    for (; next + 1 < n; ++next) {
        const double* at = place_m + 2 * std::size_t(next);
        path.push_back({at[0], at[1], height_on(chain, along_m[next])});
    }
    const double* last = place_m + 2 * std::size_t(n - 1);
    path.push_back({last[0], last[1], end_up_m});
}

namespace {

Ground checked(const In<double, 2>& up_m, const In<double, 1>& frame_m) {
    require_shape("frame_m", frame_m, {4});
    require_finite("frame_m", frame_m.data(), 4);
    if (up_m.shape(0) < 2 || up_m.shape(1) < 2) refuse("up_m must have two rows and columns");
    require_finite("up_m", up_m.data(), up_m.size());
    const double* frame = frame_m.data();
    if (!(frame[2] > 0.0 && frame[3] > 0.0)) refuse("frame_m must have steps > 0");
    return {up_m.data(), static_cast<int>(up_m.shape(0)), static_cast<int>(up_m.shape(1)),
            frame[0], frame[1], frame[2], frame[3]};
}

Out<double, 1> ground_up_m(In<double, 2> up_m, In<double, 1> frame_m, In<double, 2> place_m) {
    const Ground ground = checked(up_m, frame_m);
    require_shape("place_m", place_m, {place_m.shape(0), 2});
    require_finite("place_m", place_m.data(), place_m.size());
    std::vector<double> heights_m(place_m.shape(0));
    for (std::size_t k = 0; k < heights_m.size(); ++k) {
        heights_m[k] = ground.up(place_m.data()[2 * k], place_m.data()[2 * k + 1]);
    }
    return give(std::move(heights_m));
}

std::tuple<Out<double, 2>, Out<std::int64_t, 1>> drape_paths(
    In<double, 2> up_m, In<double, 1> frame_m, In<double, 2> place_m, In<std::int64_t, 1> first,
    In<double, 2> ends_up_m, In<double, 2> room_m) {
    const Ground ground = checked(up_m, frame_m);
    const std::size_t n_path = ends_up_m.shape(0);
    require_shape("place_m", place_m, {place_m.shape(0), 2});
    require_shape("first", first, {n_path + 1});
    require_shape("ends_up_m", ends_up_m, {n_path, 2});
    require_shape("room_m", room_m, {n_path, 2});
    require_finite("place_m", place_m.data(), place_m.size());
    require_finite("ends_up_m", ends_up_m.data(), ends_up_m.size());
    require_finite("room_m", room_m.data(), room_m.size());
    const std::int64_t* at = first.data();
    const bool sound = at[0] == 0 && at[n_path] == static_cast<std::int64_t>(place_m.shape(0));
    for (std::size_t k = 0; sound && k < n_path; ++k) {
        if (at[k + 1] < at[k] + 2) refuse("first must leave two places or more to each path");
    }
    if (!sound) refuse("first must lead from 0 to the number of places");
    std::vector<GroundPoint> path;
    std::vector<std::int64_t> begins{0};
    {
        nb::gil_scoped_release release;
        for (std::size_t k = 0; k < n_path; ++k) {
            const double *ends = ends_up_m.data() + 2 * k, *room = room_m.data() + 2 * k;
            drape(ground, place_m.data() + 2 * at[k], static_cast<int>(at[k + 1] - at[k]), ends[0],
                  ends[1], {room[0], room[1]}, path);
            begins.push_back(static_cast<std::int64_t>(path.size()));
        }
    }
    std::vector<double> points;
    points.reserve(3 * path.size());
    for (const GroundPoint& point : path) {
        points.insert(points.end(), {point.east_m, point.north_m, point.up_m});
    }
    const std::size_t shape[2] = {path.size(), 3};
    return std::make_tuple(give<double, 2>(std::move(points), shape), give(std::move(begins)));
}

}  // namespace

void bind_ground(nb::module_& module) {
    module.def("ground_up_m", &ground_up_m, nb::arg("up_m"), nb::arg("frame_m"),
               nb::arg("place_m"));
    module.def("drape_paths", &drape_paths, nb::arg("up_m"), nb::arg("frame_m"),
               nb::arg("place_m"), nb::arg("first"), nb::arg("ends_up_m"), nb::arg("room_m"));
}

}  // namespace peckorder
