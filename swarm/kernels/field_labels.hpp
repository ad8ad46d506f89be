// The best lists of one UAV for every set of tasks: label setting over (tasks done, node, landed).
//
// What may dominate what is told in field_labels.cpp: with a swap still ahead, being early is no
// virtue in itself, for who departs from a base earlier may wait longer in the air.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "field.hpp"
#include "watch.hpp"

namespace peckorder {

using FieldList = std::vector<Item>;
using TaskSet = std::uint32_t;  // of a universe of tasks, one bit each

constexpr double kImpossible = -std::numeric_limits<double>::infinity();

// How a base takes part in the lists of one UAV.
enum class BaseUse : std::uint8_t {
    kFree,      // there is always a slot
    kRelaxed,   // others may delay it there: behind it, waiting in the air costs no energy
    kForbidden  // not visited
};

// Where a UAV begins, and what its lists may hold.
struct OwnQuestion {
    const FieldProblem* problem;
    int uav;
    Progress begin;
    int landed_at;                 // base at which it stands, or -1
    std::vector<int> tasks;        // the universe, at most kMostOwnTasks
    std::vector<BaseUse> base_use; // of each base

    // Several visits in a row are a way over several bases: as many as there are bases do for every
    // way, and more would be a delay and nothing else.
    int most_in_a_row() const { return problem->n_base; }
    bool swaps() const;  // it has a battery to swap, and a base to swap it at
};

enum class Outcome : std::uint8_t { kProven, kStopped, kTooLarge };

constexpr int kMostOwnTasks = 18;
constexpr std::size_t kMostLabels = 6'000'000;  // of one UAV; 40 bytes each

// One label's extension by one item; false where that can't be. `delayed`: behind a relaxed base.
bool extend_relaxed(const OwnQuestion& question, Item item, bool& delayed, Progress& progress);

// Every set's best value and list; a set is a mask over `question.tasks`.
class OwnLists {
  public:
    OwnLists(const OwnQuestion& question, Watch& watch);

    Outcome outcome() const { return outcome_; }  // of no use but for kProven
    double value(TaskSet set) const { return value_[set]; }  // kImpossible: no list does it
    FieldList list(TaskSet set) const;
    std::size_t n_label() const { return n_label_; }

  private:
    std::vector<double> value_;
    std::vector<std::size_t> offset_;
    FieldList flat_;
    std::size_t n_label_ = 0;
    Outcome outcome_ = Outcome::kProven;
};

// The best list of one UAV over some tasks by (fewest required left out, largest J), as if it were
// alone; slots are no concern.
struct OwnBest {
    Outcome outcome = Outcome::kProven;
    int n_left_out = 0;  // required ones among the tasks
    double value = 0.0;
    FieldList list;
};
OwnBest best_list(const OwnQuestion& question, Watch& watch);

}  // namespace peckorder
