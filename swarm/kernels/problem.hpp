// A mission as the kernels see it: swarm.allocation.Problem, checked and copied into C++ once.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <mutex>
#include <vector>

namespace peckorder {

class Workspace;

// What is passed in: C-contiguous arrays that the caller has checked.
struct MissionArrays {
    int n_uav;
    int n_task;
    const double* start_m;    // (n_uav, 3)
    const double* task_m;     // (n_task, 3)
    const double* speed_m_s;  // (n_uav,)
    const double* value;      // (n_task,)
    const double* service_s;  // (n_task,)
    const double* success;    // (n_uav, n_task); 0: incapable
    const double* survival;   // (n_uav, n_task)
    double horizon_s;
    const double* acceleration_m_s2 = nullptr;  // (n_uav,) infinite: at once; null: all at once
};

// Each operation rounded by itself, in this order, as in Python.
inline double length_m(double dx, double dy, double dz) {
    return std::sqrt((dx * dx + dy * dy) + dz * dz);
}

// How one UAV takes up speed from rest and brakes to rest: d/v + v/a if it is long enough to reach v
// (d >= v²/a), else 2·√(d/a). That is 0 at 0, grows with d and is concave (both branches are, and
// they meet with the same slope 1/v), so a way round is never quicker: the triangle inequality, on
// which Theorem 5's certificate and the bounds rest, holds as it does for d/v.
struct Ramps {
    double acceleration_m_s2 = std::numeric_limits<double>::infinity();
    double both_s = 0.0;  // v/a, what speeding up and braking cost
    double both_m = 0.0;  // v²/a, their length

    Ramps() = default;
    Ramps(double speed_m_s, double acceleration_m_s2)
        : acceleration_m_s2(acceleration_m_s2) {
        if (at_once()) return;
        both_s = speed_m_s / acceleration_m_s2;
        both_m = (speed_m_s * speed_m_s) / acceleration_m_s2;
    }

    bool at_once() const { return acceleration_m_s2 == std::numeric_limits<double>::infinity(); }
    // `at_speed_s` is the length over the speed.
    double flown_s(double length_m, double at_speed_s) const {
        if (length_m >= both_m) return at_speed_s + both_s;
        return 2.0 * std::sqrt(length_m / acceleration_m_s2);
    }
};

// One UAV's legs from one place, for loops over many tasks whose coordinates stand in columns;
// two classes, so that those of a UAV whose speed changes at once ask nothing at each task.
class LegsFrom {
  public:
    LegsFrom(const double* from_m, double speed_m_s)
        : x_m_(from_m[0]), y_m_(from_m[1]), z_m_(from_m[2]), speed_m_s_(speed_m_s) {}

    double length_to_m(double x_m, double y_m, double z_m) const {
        return length_m(x_m - x_m_, y_m - y_m_, z_m - z_m_);
    }
    double travel_s(double x_m, double y_m, double z_m) const {
        return length_to_m(x_m, y_m, z_m) / speed_m_s_;
    }

  protected:
    double x_m_, y_m_, z_m_, speed_m_s_;
};

class RampedLegsFrom : public LegsFrom {
  public:
    RampedLegsFrom(const double* from_m, double speed_m_s, const Ramps& ramps)
        : LegsFrom(from_m, speed_m_s), ramps_(ramps) {}

    double travel_s(double x_m, double y_m, double z_m) const {
        const double length_m = length_to_m(x_m, y_m, z_m);
        return ramps_.flown_s(length_m, length_m / speed_m_s_);
    }

  private:
    Ramps ramps_;
};

// Every task and UAV index below is a row or column of those arrays.
class Problem {
  public:
    explicit Problem(const MissionArrays& arrays);
    ~Problem();
    Problem(const Problem&) = delete;
    Problem& operator=(const Problem&) = delete;

    int n_uav() const { return n_uav_; }
    int n_task() const { return n_task_; }
    double horizon_s() const { return horizon_s_; }
    bool certain() const { return certain_; }  // nobody is lost at a task it is capable of

    const double* start_m(int uav) const {
        return start_m_.data() + 3 * static_cast<std::size_t>(uav);
    }
    const double* place_m(int task) const {
        return task_m_.data() + 3 * static_cast<std::size_t>(task);
    }
    double value(int task) const { return value_[task]; }
    double service_s(int task) const { return service_s_[task]; }

    // Of one UAV, a task each.
    const double* weights(int uav) const { return by_uav_.weight.data() + row(uav); }  // p·m
    const double* survivals(int uav) const { return by_uav_.survival.data() + row(uav); }
    const std::uint8_t* abilities(int uav) const { return by_uav_.capable.data() + row(uav); }
    bool capable_of_all(int uav) const { return capable_of_all_[uav] != 0; }

    // -- Time of a leg: nothing else in the kernels knows how UAVs fly, straight at cruise speed, --
    // -- from rest to rest. --
    //
    // Of two roundings of one time, `travel_s` divides: it is the float of Problem.travel_s in
    // Python, of which agents tell each other. `quick_travel_s` multiplies by seconds per metre, for
    // searches that look at millions of legs and whose results are valued anew; it may be off by
    // the last bit.

    // What `use` returns of the legs of `uav` from there, of whichever class they are.
    template <typename Use>
    auto with_legs_from(int uav, const double* from_m, Use&& use) const {
        if (at_once_ || ramps_[uav].at_once()) return use(LegsFrom(from_m, speed_m_s_[uav]));
        return use(RampedLegsFrom(from_m, speed_m_s_[uav], ramps_[uav]));
    }
    double travel_s(int uav, const double* from_m, int task) const {
        const double* to_m = place_m(task);
        return with_legs_from(uav, from_m, [to_m](const auto& legs) {
            return legs.travel_s(to_m[0], to_m[1], to_m[2]);
        });
    }
    double travel_s(int uav, int from, int to) const { return travel_s(uav, place_m(from), to); }

    // From completing each of these tasks to completing each other, n * n.
    std::vector<double> legs_s(int uav, const std::vector<int>& tasks) const;

    double quick_travel_s(int uav, const double* from_m, const double* to_m) const {
        return quickly_s(uav, straight_m(from_m, to_m));
    }
    double quick_travel_s(int uav, const double* from_m, int task) const {
        return quick_travel_s(uav, from_m, place_m(task));
    }
    double quick_travel_s(int uav, int from, int to) const {
        return quickly_s(uav, between_m(from, to));
    }

    // From completing a task to completing another, quickly.
    double leg_s(int uav, int from, int to) const {
        return quick_travel_s(uav, from, to) + service_s_[to];
    }

    static double straight_m(const double* from_m, const double* to_m) {
        return length_m(to_m[0] - from_m[0], to_m[1] - from_m[1], to_m[2] - from_m[2]);
    }

    // -- For searches -------------------------------------------------------------------------------

    // Work out what follows, and keep distances for `leg_s`; who asks for anything here does so
    // first. Takes time in n_task² · log n_task, once.
    void lay_out() const;

    // As above, but one task's UAVs stand together: a search asks about many of them at a time.
    double weight(int uav, int task) const { return by_task_.weight[column(uav, task)]; }
    double survival(int uav, int task) const { return by_task_.survival[column(uav, task)]; }
    bool capable(int uav, int task) const { return by_task_.capable[column(uav, task)] != 0; }

    // Other tasks, nearest first, which for every UAV are those reached soonest, as times grow with
    // distance; as many for each task.
    int n_near() const { return n_near_; }
    const std::int32_t* near(int task) const {
        return near_.data() + static_cast<std::size_t>(task) * n_near_;
    }

    // Whether both fly all legs in equal times and have equal weights and survivals at every task.
    bool alike(int uav, int other) const;

    // Working memory is kept from call to call; it changes speed, never results.
    std::unique_ptr<Workspace> borrow_workspace() const;
    void return_workspace(std::unique_ptr<Workspace> workspace) const;

  private:
    struct Table {
        std::vector<double> weight, survival;
        std::vector<std::uint8_t> capable;
    };

    double quickly_s(int uav, double length_m) const {
        const double at_speed_s = length_m * pace_s_m_[uav];
        return at_once_ ? at_speed_s : ramps_[uav].flown_s(length_m, at_speed_s);
    }

    double between_m(int a, int b) const {
        if (!between_m_.empty()) return between_m_[static_cast<std::size_t>(a) * n_task_ + b];
        return straight_m(place_m(a), place_m(b));
    }

    std::size_t row(int uav) const { return static_cast<std::size_t>(uav) * n_task_; }
    std::size_t column(int uav, int task) const {
        return static_cast<std::size_t>(task) * n_uav_ + uav;
    }

    Table table() const;
    void turn_table() const;
    void find_near() const;

    int n_uav_, n_task_;
    double horizon_s_;
    bool certain_ = true;
    bool at_once_ = true;  // no UAV's acceleration is given, so one look at this spares those at each
    std::vector<Ramps> ramps_;
    std::vector<double> start_m_, task_m_, speed_m_s_, pace_s_m_, value_, service_s_;
    Table by_uav_;
    std::vector<std::uint8_t> capable_of_all_;

    mutable std::once_flag laid_out_;
    mutable Table by_task_;
    mutable std::vector<double> between_m_;
    mutable std::vector<std::int32_t> near_;
    mutable int n_near_ = 0;

    mutable std::mutex mutex_;
    mutable std::vector<std::unique_ptr<Workspace>> idle_;
};

}  // namespace peckorder
