// A mission as the kernels see it: swarm.allocation.Problem, copied into C++ once.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

namespace peckorder {

class Workspace;

// Every task and UAV index below is a row or column of the arrays of swarm.allocation.Problem.
struct Problem {
    int n_uav = 0;
    int n_task = 0;
    double horizon_s = 1.0;
    std::vector<double> start_m;    // 3 per UAV
    std::vector<double> x_m, y_m, z_m, service_s;  // per task
    std::vector<double> speed_m_s;  // per UAV
    std::vector<double> weight, survival;  // UAV by UAV, a task each
    std::vector<std::uint8_t> capable;     // the same
    std::vector<std::uint8_t> capable_of_all;  // per UAV

    Problem();
    ~Problem();
    Problem(const Problem&) = delete;
    Problem& operator=(const Problem&) = delete;

    std::size_t cell(int uav, int task) const {
        return static_cast<std::size_t>(uav) * static_cast<std::size_t>(n_task) +
               static_cast<std::size_t>(task);
    }

    // Straight-line flight time; each operation rounded by itself, as Problem.travel_s has it.
    double travel_s(int uav, double x, double y, double z, int task) const {
        const std::size_t t = static_cast<std::size_t>(task);
        const double dx = x_m[t] - x, dy = y_m[t] - y, dz = z_m[t] - z;
        return std::sqrt((dx * dx + dy * dy) + dz * dz) / speed_m_s[static_cast<std::size_t>(uav)];
    }

    // Working memory is kept from call to call; it changes speed, never results.
    std::unique_ptr<Workspace> borrow_workspace() const;
    void return_workspace(std::unique_ptr<Workspace> workspace) const;

  private:
    mutable std::mutex mutex_;
    mutable std::vector<std::unique_ptr<Workspace>> idle_;
};

}  // namespace peckorder
