#include "routes_moves.hpp"

#include <algorithm>

namespace peckorder {

namespace {
constexpr int kNear = 7;
constexpr int kMostCarried = 3;    // tasks from list to list at a time
constexpr int kMostWithin = 3;     // tasks to another place of their list at a time
}  // namespace

void MoveFinder::offer(Recipe& recipe) {
  const double gain = lists_.gain(recipe);
  if (!(gain > best_.gain)) return;
  best_ = recipe;
  best_.gain = gain;
}

const Recipe& MoveFinder::best(int task, double least) {
  best_.gain = least;
  best_.lists = 0;
  const int list = lists_.list_of(task);
  if (list < 0) return best_;
  const RouteTerms& terms = lists_.terms();
  const int most = std::min(kNear, terms.n_near());
  const bool outside = lists_.is_left_out(list);
  for (int k = 0; k < most; ++k) {
    const int near = terms.near(task)[k];
    const int other = lists_.list_of(near);
    if (other < 0) continue;
    if (outside) {
      if (!lists_.is_left_out(other)) take_in(task, near);
    } else if (lists_.is_left_out(other)) {
      take_in(near, task);
    } else {
      follow(task, near);
      follow(near, task);
    }
  }
  to_front(task);
  if (!outside && terms.leaves_out()) leave_out(task);
  return best_;
}

void MoveFinder::follow(int x, int y) {
  const int a = lists_.list_of(x), b = lists_.list_of(y);
  const int p = lists_.place_of(x), q = lists_.place_of(y);
  if (a == b && q == p + 1) return;
  const RouteTerms& terms = lists_.terms();
  const double new_s = terms.leg_s(lists_.uav(a), x, y);
  const auto leg_after = [&](int list, int place) {
    if (place + 1 >= lists_.size(list) || place < 0) return place < 0 ? 1e300 : 0.0;
    const Route& route = lists_.route(list);
    return terms.leg_s(lists_.uav(list), route[place], route[place + 1]);
  };
  const bool after_x = new_s < leg_after(a, p), before_y = new_s < leg_after(b, q - 1);
  if (!after_x && !before_y) return;  // no shorter than either leg that may give way
  if (a == b)
    follow_within(a, p, q, after_x, before_y);
  else
    follow_across(a, p, b, q);
}

void MoveFinder::follow_within(int list, int p, int q, bool after_x, bool before_y) {
  const int n = lists_.size(list);
  const auto offer_parts = [&](int from, int middle, int to, bool turn_first, bool turn_second) {
    // [from, middle) and [middle, to) change places
    Recipe recipe;
    recipe.begin(list);
    recipe.add(list, 0, from);
    recipe.add(list, middle, to, turn_second);
    recipe.add(list, from, middle, turn_first);
    recipe.add(list, to, n);
    offer(recipe);
  };
  const auto offer_turned = [&](int from, int to) {
    Recipe recipe;
    recipe.begin(list);
    recipe.add(list, 0, from);
    recipe.add(list, from, to, true);
    recipe.add(list, to, n);
    offer(recipe);
  };
  if (p < q) {
    if (after_x) offer_turned(p + 1, q + 1);
    if (before_y) offer_turned(p, q);
    for (int length = 1; length <= kMostWithin; ++length) {
      if (q + length <= n) offer_parts(p + 1, q, q + length, false, false);
      if (q + 1 - length > p + 1) offer_parts(p + 1, q + 1 - length, q + 1, false, true);
      if (p + 1 - length >= 0) offer_parts(p + 1 - length, p + 1, q, false, false);
      if (p + length < q) offer_parts(p, p + length, q, true, false);
    }
  } else {
    for (int length = 1; length <= kMostWithin; ++length) {
      if (q + length <= p) offer_parts(q, q + length, p + 1, false, false);
      if (q + 1 - length >= 0) offer_parts(q + 1 - length, q + 1, p + 1, true, false);
      if (p + 1 - length > q) offer_parts(q, p + 1 - length, p + 1, false, false);
      if (p + length <= n) offer_parts(q, p, p + length, false, true);
    }
  }
}

// Tasks begin..end-1 of a list to before `place` of another.
void MoveFinder::carry(int from, int begin, int end, bool turned, int to, int place) {
  if (begin < 0 || end > lists_.size(from)) return;
  Recipe recipe;
  recipe.begin(from);
  recipe.add(from, 0, begin);
  recipe.add(from, end, lists_.size(from));
  recipe.begin(to);
  recipe.add(to, 0, place);
  recipe.add(from, begin, end, turned);
  recipe.add(to, place, lists_.size(to));
  offer(recipe);
}

void MoveFinder::follow_across(int a, int p, int b, int q) {
  const int n = lists_.size(a), m = lists_.size(b);
  {
    Recipe recipe;  // exchange of tails
    recipe.begin(a);
    recipe.add(a, 0, p + 1);
    recipe.add(b, q, m);
    recipe.begin(b);
    recipe.add(b, 0, q);
    recipe.add(a, p + 1, n);
    offer(recipe);
  }
  for (int length = 1; length <= kMostCarried; ++length) {
    carry(b, q, q + length, false, a, p + 1);
    if (length > 1) carry(b, q + 1 - length, q + 1, true, a, p + 1);
    carry(a, p + 1 - length, p + 1, false, b, q);
    if (length > 1) carry(a, p, p + length, true, b, q);
  }
  const auto exchange = [&](int begin, int end, int other_begin, int other_end) {
    if (begin < 0 || other_begin < 0 || end > n || other_end > m) return;
    Recipe recipe;
    recipe.begin(a);
    recipe.add(a, 0, begin);
    recipe.add(b, other_begin, other_end);
    recipe.add(a, end, n);
    recipe.begin(b);
    recipe.add(b, 0, other_begin);
    recipe.add(a, begin, end);
    recipe.add(b, other_end, m);
    offer(recipe);
  };
  for (int given = 1; given <= kMostCarried; ++given) {
    for (int taken = 1; taken <= kMostCarried; ++taken) {
      exchange(p + 1, p + 1 + given, q, q + taken);
      exchange(p + 1 - given, p + 1, q - taken, q);
    }
  }
}

// From wherever it is, with up to two tasks after it, to the beginning of each list.
void MoveFinder::to_front(int task) {
  const int list = lists_.list_of(task), place = lists_.place_of(task);
  const int size = lists_.size(list);
  for (int to = 0; to < lists_.n_list(); ++to) {
    if (lists_.is_left_out(to)) continue;
    if (to != list) {
      const int most = lists_.is_left_out(list) ? 1 : kMostCarried;
      for (int length = 1; length <= most; ++length)
        carry(list, place, place + length, false, to, 0);
      continue;
    }
    if (place == 0) continue;
    Recipe turned;
    turned.begin(list);
    turned.add(list, 0, place + 1, true);
    turned.add(list, place + 1, size);
    offer(turned);
    for (int length = 1; length <= kMostWithin && place + length <= size; ++length) {
      Recipe recipe;
      recipe.begin(list);
      recipe.add(list, place, place + length);
      recipe.add(list, 0, place);
      recipe.add(list, place + length, size);
      offer(recipe);
    }
  }
}

void MoveFinder::leave_out(int task) {
  const int list = lists_.list_of(task), place = lists_.place_of(task);
  const int outside = lists_.n_list() - 1;
  for (int length = 1; length <= kMostCarried; ++length)
    carry(list, place, place + length, false, outside, lists_.size(outside));
}

// `task` is left out: let it come right after or before `near`, for up to three tasks there.
void MoveFinder::take_in(int task, int near) {
  const int outside = lists_.list_of(task), place = lists_.place_of(task);
  const int list = lists_.list_of(near), n = lists_.size(list);
  const auto offer_at = [&](int begin, int end) {
    if (begin < 0 || end > n) return;
    Recipe recipe;
    recipe.begin(list);
    recipe.add(list, 0, begin);
    recipe.add(outside, place, place + 1);
    recipe.add(list, end, n);
    recipe.begin(outside);
    recipe.add(outside, 0, place);
    recipe.add(outside, place + 1, lists_.size(outside));
    recipe.add(list, begin, end);
    offer(recipe);
  };
  const int here = lists_.place_of(near);
  for (int given = 0; given <= kMostCarried; ++given) {
    offer_at(here + 1, here + 1 + given);
    offer_at(here - given, here);
  }
  offer_at(here, here + 1);
}

}  // namespace peckorder
