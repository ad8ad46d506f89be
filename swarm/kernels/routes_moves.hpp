// The best move that makes a task follow, or be followed by, one of its near neighbours.
//
// Granular neighbourhoods (Toth and Vigo 2003, doi:10.1287/ijoc.15.4.333.24890) of 2-opt, or-opt and
// tails, within and between lists, and exchanges of one to three tasks for none to three.
#pragma once

#include "routes_lists.hpp"

namespace peckorder {

class MoveFinder {
 public:
  explicit MoveFinder(TimedLists& lists) : lists_(lists) {}

  // The move that gains most and more than `least`; `lists` is 0 in it if there is none.
  const Recipe& best(int task, double least);

 private:
  void follow(int x, int y);       // let y come right after x
  void follow_within(int list, int p, int q, bool after_x, bool before_y);
  void follow_across(int a, int p, int b, int q);
  void to_front(int task);
  void leave_out(int task);
  void take_in(int task, int near);
  void carry(int from, int begin, int end, bool turned, int to, int place);
  void offer(Recipe& recipe);

  TimedLists& lists_;
  Recipe best_;
};

}  // namespace peckorder
