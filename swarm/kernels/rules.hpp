// Decision rules: how a UAV whose turn it is chooses its next task. Ties go to the smaller index.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "problem.hpp"
#include "tours.hpp"

namespace peckorder {

enum class RuleCode : int { kGreedy = 0, kLookahead = 1 };

// lookahead is exact up to this many open tasks that the UAV is capable of.
constexpr int kExactTasks = 12;

// Open tasks in ascending order, one column per quantity.
class OpenTasks {
  public:
    void assign(const Problem& problem, const std::uint8_t* open);
    void assign_capable(const Problem& problem, const OpenTasks& all, int uav);
    void remove(std::size_t place);
    void remove_task(int task);
    std::size_t size() const { return task.size(); }
    bool empty() const { return task.empty(); }

    std::vector<std::int32_t> task;
    std::vector<double> x_m, y_m, z_m, service_s;
};

// One UAV whose turn it is.
struct Decider {
    int uav;
    double free_s;
    double place_m[3];
    double survived;
};

struct Choice {
    int task = -1;  // -1: nothing open that it is capable of
    double completion_s = 0.0;
    double score = 0.0;
    double second = 0.0;
    bool has_second = false;
    bool certificate = false;
    bool exact = true;
};

// Working memory of one thread, and its tour tables.
class Workspace {
  public:
    // The decision of a UAV by a rule; brief: greedy leaves out second and certificate.
    Choice decide(const Problem& problem, const OpenTasks& open, const Decider& decider,
                  RuleCode rule, bool brief);

    // After a decision that was not brief: tasks and what the rule makes of them, the one taken
    // first, then the others from the best on. A long tour values the task it begins with alone.
    std::vector<std::pair<int, double>> valued(const Choice& choice, std::size_t most) const;

    OpenTasks open;  // of the simulation that borrows this

  private:
    struct Table {
        std::vector<std::int32_t> tasks;
        std::unique_ptr<TourTable> tours;
    };

    Choice decide_briefly(const Problem& problem, const Decider& decider);
    Choice decide_greedily(const Problem& problem, const Decider& decider);
    Choice look_ahead(const Problem& problem, const Decider& decider);
    Choice look_ahead_far(const Problem& problem, const Decider& decider);
    void look_out(const Problem& problem, const Decider& decider);
    bool certificate(const Problem& problem, const Decider& decider, std::size_t best, double second);
    bool rest_is_worth_flying(const Problem& problem, const Decider& decider, std::size_t best);
    const Table& table(const Problem& problem, int uav);

    const OpenTasks* tasks_ = nullptr;  // those the decider is capable of
    const std::vector<double>* values_ = nullptr;  // of each by the rule; none for a long tour
    OpenTasks capable_;
    std::vector<double> completion_s_, score_, weight_;
    std::vector<double> tour_completion_s_, tour_survival_;
    std::vector<std::int32_t> picked_;
    std::vector<Table> tables_;
    std::size_t table_bytes_ = 0;
};

}  // namespace peckorder
