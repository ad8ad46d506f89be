// The best complete tours of one UAV over every subset of a few tasks (eq. 6), exactly.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "watch.hpp"

namespace peckorder {

// For every set of tasks and every first task of it: what the rest of the best tour is worth as a
// function of when the first one is completed. It does not depend on where the UAV is, so one table
// serves all decisions over subsets of its tasks. A subset is a bit mask of positions 0..n-1.
class TourTable {
  public:
    static constexpr int kMostTasks = 18;
    static constexpr int kMostUncertainTasks = 16;

    // weight[n]: p·m; negative ones find the worst tours. survival[n]. leg_s[n * n]: time from
    // completing i to completing j at [i * n + j].
    // Of no use once the watch has stopped it.
    TourTable(int n, const double* weight, const double* survival, const double* leg_s,
              double horizon_s, Watch& watch);

    int size() const { return n_; }
    std::size_t bytes() const;

    // values[n]: worth of the best tour over mask by its first task, with S = 1 before it;
    // -infinity for tasks outside. completion_s[n]: of each task if it is first.
    void first_values(std::uint32_t mask, const double* completion_s, double* values) const;

    // best[1 << n]: worth of the best tour over every subset; 0 for the empty one.
    void values(const double* completion_s, double* best, Watch& watch) const;

    // Positions in order of the best tour over mask.
    std::vector<int> best_tour(std::uint32_t mask, const double* completion_s) const;

  private:
    struct Label {  // a tour worth constant − slope · τ, τ being its first completion
        double constant, slope;
    };

    void build_costs(const double* weight, Watch& watch);
    void build_labels(const double* weight, const double* survival, Watch& watch);
    static void keep_envelope(std::vector<Label>& candidates);

    int n_;
    bool certain_;
    double horizon_s_;
    std::vector<double> leg_s_;
    // Survival 1: Σ weight of every set; Σ weight × time after completing k over the best tour of R
    // from k at [R * n + k].
    std::vector<double> total_, cost_;
    // Survival below 1: the labels of (mask, first) are labels_[offset_[s]] up to
    // labels_[offset_[s + 1]], s = mask * n + first.
    std::vector<std::uint64_t> offset_;
    std::vector<Label> labels_;
};

}  // namespace peckorder
