// Ends of lists, built from their last task on, exact in time.
//
// A tail that begins with task i, completed at time t, is worth a − w·t, w the weight of all its
// tasks: a line. Setting h before it makes a' = a − w·leg + w_h·D − price_h, w' = w + w_h. So no time
// need be cut into pieces, and what the tails of one task are worth at most is a convex piecewise
// linear function of t. A line is kept for those times at which no other that remembers no more
// (`Memory`) is as good.
#pragma once

#include <vector>

#include "routes_offer.hpp"

namespace peckorder {

class Tails {
 public:
  // Where the watch has stopped it, nothing here says anything.
  Tails(const Offer& offer, Watch& watch);

  // Too many of them: then nothing here says anything.
  bool overflown() const { return overflown_; }

  // Most that a tail beginning with `i`, completed then, earns that holds none of the other tasks
  // that the list is known to have been to; `i` itself counted in.
  double best(int i, double time_s, Memory known) const {
    double best = offer_.gain(i, time_s);
    const Memory others = known & ~Memory{1};
    for (const Line& line : lines_[i])
      if ((line.known & others) == 0) best = line.a - line.w * time_s > best ? line.a - line.w * time_s : best;
    return best;
  }

  // The tasks of that tail after `i`.
  void append_best(int i, double time_s, Memory known, Route& list) const;

 private:
  struct Line {
    double a, w;
    Memory known;
    int born;  // in order, and where it stands in `nodes_`
  };
  struct Node {
    int task, next;  // `next` in nodes_
  };
  struct Span {
    double from_s, until_s;
    bool empty() const { return !(from_s <= until_s); }
  };

  // The times of `span` at which no other line of the task is as good. With `sort`
  // who outdoes the line moves towards the front, where the next one meets it sooner.
  Span useful(int i, const Line& line, Span span, bool sort = true);
  bool extend(int i, const Line& line, Watch& watch);
  void tidy(int i, Watch& watch);
  // What it takes to hold one line against all of a task.
  std::int64_t steps_among(int i) const {
    return static_cast<std::int64_t>(lines_[i].size()) / 4 + 2;
  }

  const Offer& offer_;
  std::vector<std::vector<Line>> lines_;   // per first task
  std::vector<std::vector<Line>> coming_;  // those of `lines_` not yet looked at
  std::vector<Node> nodes_;
  bool overflown_ = false;
};

}  // namespace peckorder
