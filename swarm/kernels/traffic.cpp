// Whom a UAV has heard near it, and whether any of these is a reason to fly otherwise than it does:
// what each asks several times a second, mostly to find that nobody is. What it means is defined in
// swarm/separation: tactical.py, tactical_look.py and tactical_traffic.py.

#include <nanobind/stl/array.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <tuple>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "motions.hpp"

namespace peckorder {

namespace {

constexpr double kEndless = std::numeric_limits<double>::infinity();
constexpr double kMostSteps = 100000.0;
constexpr double kRoundingM = 1e-6;

using Precedence = std::array<std::int64_t, 3>;  // grade, rank, depth

// Numbers of a fleet; names and units as in swarm.separation.tactical_traffic.TrafficRules.
struct Rules {
    double separation_m, apart_m, reach_m, fastest_m_s, acceleration_m_s2, climb_m_s, reaction_s,
        tick_s, beacon_s, horizon_s, step_s, silent_s, forget_s, grid_m, wide_m, reach_slack_m,
        stands_m, most_column_m, column_step_m;

    double stop_m(double speed) const { return speed * speed / (2.0 * acceleration_m_s2); }
    int steps(double span_s) const {
        return static_cast<int>(std::min(std::ceil(span_s / step_s), kMostSteps));
    }
};

struct Stray {
    double flat_m, upright_m;
};

// An upright cylinder.
struct Cylinder {
    Vector centre;
    double radius, low, high;

    double distance_m(const Cylinder& other) const {
        const double east = centre[0] - other.centre[0], north = centre[1] - other.centre[1];
        const double flat =
            std::max(0.0, std::sqrt(east * east + north * north) - radius - other.radius);
        const double upright = std::max({0.0, low - other.high, other.low - high});
        return std::sqrt(flat * flat + upright * upright);
    }

    Cylinder grown(const Stray& stray) const {
        return {centre, radius + stray.flat_m, low - stray.upright_m, high + stray.upright_m};
    }
};

// How one flies, and what of its reach does not depend on for how long.
struct Flown {
    Flight flight;
    double told_m_s;  // how fast it moves
    double fast_m_s;  // how fast it may move on its path
    double low_m, high_m;

    Flown(Flight given, const Rules& rules) : flight(std::move(given)) {
        told_m_s = length(flight.velocity);
        fast_m_s = flight.path.empty() ? told_m_s : std::max(told_m_s, flight.speed);
        low_m = high_m = flight.place[2];
        double rise = std::abs(flight.velocity[2]);
        Vector here = flight.place;
        for (const Vector& corner : flight.path) {
            low_m = std::min(low_m, corner[2]);
            high_m = std::max(high_m, corner[2]);
            const Vector leg{corner[0] - here[0], corner[1] - here[1], corner[2] - here[2]};
            const double steep = std::abs(leg[2]);
            if (steep > 0.0) {
                rise = std::max(rise, std::min(flight.speed * steep / length(leg), rules.climb_m_s));
            }
            here = corner;
        }
        const double over =
            rise * 2.0 * fast_m_s / rules.acceleration_m_s2 + rules.reach_slack_m;
        low_m -= over;
        high_m += over;
    }

    Cylinder reach(const Rules& rules, double drive_s, bool brakes) const {
        double far = rules.stop_m(told_m_s);
        if (!flight.path.empty()) {
            far = fast_m_s * drive_s + (brakes ? rules.stop_m(fast_m_s) : 0.0);
        }
        far += fast_m_s * rules.step_s;
        return {flight.place, far + rules.reach_slack_m, low_m, high_m};
    }

    std::vector<double> motion(const Rules& rules, double drive_s, double span_s) const {
        return sampled(flight, rules.acceleration_m_s2, rules.climb_m_s, drive_s, rules.step_s,
                       rules.steps(span_s));
    }

    // Until it stands, if it brakes after drive_s.
    std::vector<double> stops(const Rules& rules, double drive_s) const {
        const double fast = std::max(flight.speed, told_m_s);
        return motion(rules, drive_s, drive_s + fast / rules.acceleration_m_s2 + rules.step_s);
    }
};

Stray stray_after(double age_s, double speed, const Rules& rules) {
    const double change = rules.acceleration_m_s2 * age_s;
    const double flown = 0.5 * rules.acceleration_m_s2 * age_s * age_s;
    const double rise = std::min(change, rules.climb_m_s);
    return {flown + change * (speed + change) / (2.0 * rules.acceleration_m_s2),
            std::min(flown, rise * age_s) + rules.stop_m(rise)};
}

struct Track {
    Flown flown;
    double said_s;
    Precedence precedence;
    bool upright;
    double column_end_m;

    double age_s(double now_s) const { return std::max(0.0, now_s - said_s); }

    Cylinder halts(const Rules& rules, double now_s) const {
        return flown.reach(rules, drive_s(rules, now_s), true).grown(stray(rules, age_s(now_s)));
    }

    std::vector<double> stops(const Rules& rules, double now_s) const {
        return flown.stops(rules, drive_s(rules, now_s));
    }

    // How long it may have flown on as it said before it brakes.
    double drive_s(const Rules& rules, double now_s) const {
        return std::min(age_s(now_s), rules.forget_s) + rules.reaction_s + rules.tick_s;
    }

    Stray stray(const Rules& rules, double age) const {
        return stray_after(std::min(age, rules.silent_s), flown.told_m_s, rules);
    }

    Cylinder column() const {
        const Vector& here = flown.flight.place;
        return {here, 0.0, std::min(here[2], column_end_m), std::max(here[2], column_end_m)};
    }

    std::vector<double> column_places(const Rules& rules) const {
        const Vector& here = flown.flight.place;
        const double far = column_end_m - here[2];
        const int samples = 2 + static_cast<int>(std::ceil(std::abs(far) / rules.column_step_m));
        std::vector<double> places;
        for (int k = 0; k < samples; ++k) {
            places.insert(places.end(), {here[0], here[1], here[2] + k * (far / (samples - 1))});
        }
        return places;
    }
};

class TrafficTable {
public:
    explicit TrafficTable(const std::array<double, 19>& r)
        : rules_{r[0], r[1], r[2], r[3], r[4],  r[5],  r[6],  r[7],  r[8], r[9],
                 r[10], r[11], r[12], r[13], r[14], r[15], r[16], r[17], r[18]} {
        require_finite("rules", r.data(), 13);
        require_within("acceleration_m_s2", r[4], 1e-9, kEndless, "positive");
        require_within("step_s", r[10], 1e-9, kEndless, "positive");
        require_within("column_step_m", r[18], 1e-9, kEndless, "positive");
    }

    void hear(int number, const Vector& place, const Vector& velocity, std::vector<Vector> path,
              double speed, double said_s, const Precedence& precedence) {
        Flown flown = checked(place, velocity, std::move(path), speed);
        require_within("said_s", said_s, -1e18, 1e18, "finite");
        bool upright = precedence[0] == 0 && !flown.flight.path.empty();
        double end_m = place[2];
        if (upright) {
            const Vector& end = flown.flight.path.back();
            const double east = place[0] - end[0], north = place[1] - end[1];
            upright = std::sqrt(east * east + north * north) <= rules_.stands_m;
            end_m = std::clamp(end[2], place[2] - rules_.most_column_m,
                               place[2] + rules_.most_column_m);
        }
        tracks_.insert_or_assign(number,
                                 Track{std::move(flown), said_s, precedence, upright, end_m});
    }

    void forget(int number) { tracks_.erase(number); }

    // Whether anybody is near, whether somebody near has been silent or is to be forgotten, and
    // whether somebody is in the way or bars it, if all who do not go after it go first.
    std::tuple<bool, bool, bool> look(const Vector& place, const Vector& velocity,
                                      std::vector<Vector> path, double speed, double now_s,
                                      const Precedence& precedence) const {
        const Flown own = checked(place, velocity, std::move(path), speed);
        const bool moves = !own.flight.path.empty();
        const double drive_s = rules_.tick_s + rules_.reaction_s;
        const Cylinder ahead = own.reach(rules_, rules_.horizon_s, false);
        const Cylinder halt = own.reach(rules_, drive_s, true);
        std::vector<double> way, stop;
        bool any = false;
        for (const auto& [number, track] : tracks_) {
            const double age = now_s - track.said_s;
            if (age > rules_.forget_s) return {any, true, false};
            if (!is_near(track, place, age)) continue;
            any = true;
            if (age > rules_.silent_s) return {any, true, false};
            const bool first = track.precedence[0] == 0 || !(precedence < track.precedence);
            if (first && is_in_way(track, own, ahead, way, now_s)) return {any, false, true};
            if (moves && is_barred(track, own, halt, drive_s, stop, now_s)) {
                return {any, false, true};
            }
        }
        return {any, false, false};
    }

    // For how long nobody near is close, see swarm.separation.tactical_look.free_s, and whether some
    // have been silent or are to be forgotten, and nothing is known therefore.
    std::tuple<double, bool> free_s(const Vector& place, const Vector& velocity,
                                    std::vector<Vector> path, double speed, double now_s,
                                    bool gives_way) const {
        const Track me{checked(place, velocity, std::move(path), speed), now_s - rules_.tick_s, {},
                       false, 0.0};
        const auto most = static_cast<std::size_t>(
            std::min(std::ceil(rules_.beacon_s / rules_.step_s), kMostSteps));
        std::vector<std::vector<double>> stops(most + 1);
        std::size_t free = most;
        for (const auto& [number, track] : tracks_) {
            const double age = now_s - track.said_s;
            if (age > rules_.forget_s) return {0.0, true};
            if (!is_near(track, place, age)) continue;
            if (age > rules_.silent_s) return {0.0, true};
            if (!(gives_way || track.precedence[0] != 0)) continue;
            for (std::size_t step = 1; step <= free; ++step) {
                if (may_brake(track, me, stops[step], now_s + step * rules_.step_s)) {
                    free = step - 1;
                }
            }
        }
        return {free == most ? rules_.beacon_s : free * rules_.step_s, false};
    }

private:
    Flown checked(const Vector& place, const Vector& velocity, std::vector<Vector> path,
                  double speed) const {
        require_finite("place_m", place.data(), 3);
        require_finite("velocity_m_s", velocity.data(), 3);
        for (const Vector& corner : path) require_finite("path_m", corner.data(), 3);
        require_within("speed_m_s", speed, 0.0, 1e18, "finite, and 0 or more");
        return Flown(Flight{place, velocity, std::move(path), speed}, rules_);
    }

    bool is_near(const Track& track, const Vector& place, double age) const {
        const Vector& there = track.flown.flight.place;
        const Vector away{place[0] - there[0], place[1] - there[1], place[2] - there[2]};
        return length(away) <= rules_.reach_m + rules_.fastest_m_s * age;
    }

    bool is_in_way(const Track& track, const Flown& own, const Cylinder& ahead,
                   std::vector<double>& way, double now_s) const {
        const double asked_m = rules_.apart_m, age = track.age_s(now_s);
        const double span_s = age + rules_.horizon_s;
        const Cylinder theirs = track.flown.reach(rules_, span_s, false);
        if (!(ahead.distance_m(theirs) < asked_m + kRoundingM ||
              (track.upright && ahead.distance_m(track.column()) < asked_m + kRoundingM))) {
            return false;
        }
        const std::size_t samples = 1 + static_cast<std::size_t>(rules_.steps(rules_.horizon_s));
        if (way.empty()) way = own.motion(rules_, kEndless, rules_.horizon_s);
        const std::vector<double> all = track.flown.motion(rules_, kEndless, span_s);
        const double* expected = all.data() + all.size() - 3 * samples;
        const Vector apart{way[0] - expected[0], way[1] - expected[1], way[2] - expected[2]};
        const double here_m = length(apart) - rules_.grid_m;
        const double least_m = std::sqrt(nearest(way.data(), expected, samples).first);
        if (least_m < std::min(asked_m, here_m) + kRoundingM) return true;
        if (!track.upright) return false;
        const std::vector<double> column = track.column_places(rules_);
        const auto least = [&](std::size_t count) {
            return std::sqrt(least_squared(way.data(), count, column.data(), column.size() / 3, 0.0,
                                           0.0));
        };
        return least(samples) < std::min(asked_m, least(1) - rules_.grid_m) + kRoundingM;
    }

    bool is_barred(const Track& track, const Flown& own, const Cylinder& halt, double drive_s,
                   std::vector<double>& stop, double now_s) const {
        const double asked_m = rules_.separation_m + rules_.grid_m + kRoundingM;
        if (halt.distance_m(track.halts(rules_, now_s)) >= asked_m) return false;
        if (stop.empty()) stop = own.stops(rules_, drive_s);
        const std::vector<double> theirs = track.stops(rules_, now_s);
        const Stray stray = track.stray(rules_, track.age_s(now_s));
        const auto least = [&](std::size_t count, const Stray& by) {
            return std::sqrt(least_squared(stop.data(), count, theirs.data(), theirs.size() / 3,
                                           by.flat_m, by.upright_m));
        };
        const std::size_t all = stop.size() / 3;
        if (least(all, stray) >= asked_m) return false;
        if (least(1, stray) >= asked_m - 2.0 * kRoundingM) return true;
        return least(all, {0.0, 0.0}) < least(1, {0.0, 0.0}) - rules_.grid_m + kRoundingM;
    }

    // Either of two before the other, which may have turned while it flew on as it said; stops: of
    // the one, once known.
    bool may_brake(const Track& track, const Track& me, std::vector<double>& stops,
                   double then_s) const {
        const double asked_m = rules_.separation_m + rules_.grid_m + rules_.wide_m;
        if (me.halts(rules_, then_s).distance_m(track.halts(rules_, then_s)) >= asked_m) {
            return false;
        }
        if (stops.empty()) stops = me.stops(rules_, then_s);
        const std::vector<double> theirs = track.stops(rules_, then_s);
        const auto is_barred_by = [&](const Track& turned) {
            const Stray by = turned.stray(rules_, turned.age_s(then_s));
            return std::sqrt(least_squared(stops.data(), stops.size() / 3, theirs.data(),
                                           theirs.size() / 3, by.flat_m, by.upright_m)) < asked_m;
        };
        return is_barred_by(me) || is_barred_by(track);
    }

    Rules rules_;
    std::map<int, Track> tracks_;
};

}  // namespace

void bind_traffic(nb::module_& module) {
    nb::class_<TrafficTable>(module, "TrafficTable")
        .def(nb::init<const std::array<double, 19>&>(), nb::arg("rules"))
        .def("hear", &TrafficTable::hear, nb::arg("number"), nb::arg("place_m"),
             nb::arg("velocity_m_s"), nb::arg("path_m"), nb::arg("speed_m_s"), nb::arg("said_s"),
             nb::arg("precedence"))
        .def("forget", &TrafficTable::forget, nb::arg("number"))
        .def("look", &TrafficTable::look, nb::arg("place_m"), nb::arg("velocity_m_s"),
             nb::arg("path_m"), nb::arg("speed_m_s"), nb::arg("now_s"), nb::arg("precedence"))
        .def("free_s", &TrafficTable::free_s, nb::arg("place_m"), nb::arg("velocity_m_s"),
             nb::arg("path_m"), nb::arg("speed_m_s"), nb::arg("now_s"), nb::arg("gives_way"));
}

}  // namespace peckorder
