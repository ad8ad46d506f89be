#include "routes_local.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace peckorder {

namespace {

constexpr int kMostMoved = 3;    // tasks moved between lists at a time
constexpr int kNearForPair = 12; // lists are compared if a task is this near to one of the other
constexpr double kLeastGain = 1e-10;  // of the mean list value: below is rounding

// A rearrangement of one list or of two.
struct Change {
  double gain = 0.0;
  int uav[2] = {-1, -1};
  Route route[2];
};

class LocalSearch {
 public:
  LocalSearch(Solution& solution, const std::vector<int>& uavs, Watch& watch)
      : solution_(solution),
        problem_(solution.problem()),
        watch_(watch),
        uavs_(uavs),
        dirty_(problem_.n_uav(), 1) {
    if (!uavs.empty()) {
      double sum = 0.0;
      for (const int uav : uavs) sum += std::abs(solution.route_value(uav));
      least_ = kLeastGain * sum / static_cast<double>(uavs.size()) + 1e-12;
    }
  }

  void run() {
    for (bool again = true; again && !watch_.stopped();) {
      again = false;
      for (const int uav : uavs_)
        if (dirty_[uav])
          while (improve_one(uav)) again = true;
      const std::vector<std::uint8_t> was_dirty = dirty_;
      std::fill(dirty_.begin(), dirty_.end(), std::uint8_t{0});
      for (const int a : uavs_) {
        for (const int b : beside(a, was_dirty)) {
          while (improve_two(a, b)) again = true;
        }
      }
    }
  }

 private:
  // UAVs b > a whose lists come near a's, where either has changed; idle UAVs come near all.
  std::vector<int> beside(int a, const std::vector<std::uint8_t>& was_dirty) const {
    std::vector<std::uint8_t> found(problem_.n_uav(), 0);
    const bool idle = solution_.route(a).empty();
    watch_.stops_after(static_cast<long>(solution_.route(a).size()) * kNearForPair);
    for (const int task : solution_.route(a)) {
      const int most = std::min(kNearForPair, problem_.n_near());
      for (int k = 0; k < most; ++k) {
        const int uav = solution_.uav_of(problem_.near(task)[k]);
        if (uav >= 0) found[uav] = 1;
      }
    }
    std::vector<int> uavs;
    for (const int b : uavs_) {
      if (b == a || !(found[b] || idle || solution_.route(b).empty())) continue;
      if (was_dirty[a] || was_dirty[b] || dirty_[a] || dirty_[b]) uavs.push_back(b);
    }
    return uavs;
  }

  Segment one(int uav, int task) const {
    return single(task, problem_.weight(uav, task), problem_.survival(uav, task),
                  problem_.horizon_s());
  }

  Segment join(int uav, const Segment& a, const Segment& b) const {
    if (a.empty()) return b;
    if (b.empty()) return a;
    return joined(a, b, problem_.leg_s(uav, a.last, b.first));
  }

  // Present worth of a list from `place` on, seen from the beginning of the list.
  double worth_now(int uav, int place) const {
    return solution_.survived_before(uav, place) * solution_.tail_worth(uav, place);
  }

  void offer(double gain, Change& best, int kind, int a, int b, int c) {
    if (gain > best.gain) {
      best.gain = gain;
      kind_ = kind;
      at_ = {a, b, c};
    }
  }

  bool improve_one(int uav) {
    const Route& route = solution_.route(uav);
    const int size = static_cast<int>(route.size());
    Change best;
    best.gain = least_;
    for (int i = 0; i + 1 < size; ++i) {
      if (watch_.stops_after(size - i)) return false;
      const double now = worth_now(uav, i);
      Segment reversed = one(uav, route[i]);
      for (int k = i + 1; k < size; ++k) {
        reversed = join(uav, one(uav, route[k]), reversed);
        offer(worth_from(solution_, uav, i, reversed, k + 1) - now, best, kReverse, i, k + 1, 0);
      }
    }
    // neighbouring parts [a, b) and [b, c) change places; the short one may turn round
    for (int a = 0; a + 1 < size; ++a) {
      if (watch_.stops_after(2 * kMostMoved * (size - a))) return false;
      Segment part, turned;
      for (int b = a + 1; b < size && b - a <= kMostMoved; ++b) {
        part = join(uav, part, one(uav, route[b - 1]));
        turned = join(uav, one(uav, route[b - 1]), turned);
        Segment other;
        const double now = worth_now(uav, a);
        for (int c = b + 1; c <= size; ++c) {
          other = join(uav, other, one(uav, route[c - 1]));
          offer(worth_from(solution_, uav, a, join(uav, other, part), c) - now, best, kSwapParts,
                a, b, c);
          offer(worth_from(solution_, uav, a, join(uav, other, turned), c) - now, best,
                kTurnFirst, a, b, c);
        }
      }
    }
    for (int c = size; c > 1; --c) {
      if (watch_.stops_after(2 * kMostMoved * c)) return false;
      Segment part, turned;
      for (int b = c - 1; b > 0 && c - b <= kMostMoved; --b) {
        part = join(uav, one(uav, route[b]), part);
        turned = join(uav, turned, one(uav, route[b]));
        Segment other;
        for (int a = b - 1; a >= 0; --a) {
          other = join(uav, one(uav, route[a]), other);
          const double now = worth_now(uav, a);
          offer(worth_from(solution_, uav, a, join(uav, part, other), c) - now, best, kSwapParts,
                a, b, c);
          offer(worth_from(solution_, uav, a, join(uav, turned, other), c) - now, best,
                kTurnSecond, a, b, c);
        }
      }
    }
    if (!(best.gain > least_)) return false;
    Route changed = route;
    const auto begin = changed.begin();
    const auto [a, b, c] = at_;
    switch (kind_) {
      case kReverse:
        std::reverse(begin + a, begin + b);
        break;
      case kTurnFirst:
        std::reverse(begin + a, begin + b);
        std::rotate(begin + a, begin + b, begin + c);
        break;
      case kTurnSecond:
        std::reverse(begin + b, begin + c);
        std::rotate(begin + a, begin + b, begin + c);
        break;
      default:
        std::rotate(begin + a, begin + b, begin + c);
    }
    solution_.set_route(uav, changed);
    dirty_[uav] = 1;
    return true;
  }

  bool able(int uav, const Route& route, int from, int to) const {
    for (int k = from; k < to; ++k)
      if (!problem_.capable(uav, route[k])) return false;
    return true;
  }

  // Tails of `from`'s list as `to` would fly them; empty at the end of the list.
  void foreign_tails(int from, int to, std::vector<Segment>& tails, int& first_able) const {
    const Route& route = solution_.route(from);
    const int size = static_cast<int>(route.size());
    tails.assign(size + 1, Segment{});
    first_able = size;
    bool able_so_far = true;
    for (int k = size - 1; k >= 0; --k) {
      able_so_far = able_so_far && problem_.capable(to, route[k]);
      if (!able_so_far) break;
      first_able = k;
      tails[k] = join(to, one(to, route[k]), tails[k + 1]);
    }
  }

  void try_moving(int from, int to, Change& best, int kind) {
    const Route& source = solution_.route(from);
    const Route& target = solution_.route(to);
    const int size = static_cast<int>(source.size());
    const int room = static_cast<int>(target.size());
    for (int i = 0; i < size; ++i) {
      if (watch_.stops_after(2 * kMostMoved * (room + 1))) return;
      const double now = worth_now(from, i);
      Segment part, turned;
      for (int end = i + 1; end <= size && end - i <= kMostMoved; ++end) {
        if (!problem_.capable(to, source[end - 1])) break;
        part = join(to, part, one(to, source[end - 1]));
        turned = join(to, one(to, source[end - 1]), turned);
        const double freed = worth_from(solution_, from, i, Segment{}, end) - now;
        for (int k = 0; k <= room; ++k) {
          const double before = freed - worth_now(to, k);
          offer(before + worth_from(solution_, to, k, part, k), best, kind, i, end, k);
          if (end - i > 1)
            offer(before + worth_from(solution_, to, k, turned, k), best, kind + 1, i, end, k);
        }
      }
    }
  }

  bool improve_two(int a, int b) {
    const Route& first = solution_.route(a);
    const Route& second = solution_.route(b);
    const int n = static_cast<int>(first.size()), m = static_cast<int>(second.size());
    Change best;
    best.gain = least_;
    try_moving(a, b, best, kMoveTo);
    try_moving(b, a, best, kMoveFrom);
    for (int i = 0; i < n; ++i) {
      if (watch_.stops_after(m + 1)) return false;
      if (!problem_.capable(b, first[i])) continue;
      const Segment given = one(b, first[i]);
      const double now = worth_now(a, i);
      for (int k = 0; k < m; ++k) {
        if (!problem_.capable(a, second[k])) continue;
        const double gain = worth_from(solution_, a, i, one(a, second[k]), i + 1) - now +
                            worth_from(solution_, b, k, given, k + 1) - worth_now(b, k);
        offer(gain, best, kExchange, i, k, 0);
      }
    }
    int able_a, able_b;  // from where on the other UAV is capable of the tail
    foreign_tails(a, b, tails_of_a_, able_a);
    foreign_tails(b, a, tails_of_b_, able_b);
    for (int i = able_a; i <= n; ++i) {
      if (watch_.stops_after(m + 1)) return false;
      const double now = worth_now(a, i);
      for (int k = able_b; k <= m; ++k) {
        const double gain = worth_from(solution_, a, i, tails_of_b_[k], n) - now +
                            worth_from(solution_, b, k, tails_of_a_[i], m) - worth_now(b, k);
        offer(gain, best, kTails, i, k, 0);
      }
    }
    if (!(best.gain > least_)) return false;
    apply_to_two(a, b);
    dirty_[a] = dirty_[b] = 1;
    return true;
  }

  void apply_to_two(int a, int b) {
    Route first = solution_.route(a), second = solution_.route(b);
    const auto [i, k, place] = at_;
    if (kind_ == kExchange) {
      std::swap(first[i], second[k]);
    } else if (kind_ == kTails) {
      Route tail(first.begin() + i, first.end());
      first.erase(first.begin() + i, first.end());
      first.insert(first.end(), second.begin() + k, second.end());
      second.erase(second.begin() + k, second.end());
      second.insert(second.end(), tail.begin(), tail.end());
    } else {
      const bool away = kind_ == kMoveTo || kind_ == kMoveTo + 1;
      Route& source = away ? first : second;
      Route& target = away ? second : first;
      Route part(source.begin() + i, source.begin() + k);
      if (kind_ == kMoveTo + 1 || kind_ == kMoveFrom + 1) std::reverse(part.begin(), part.end());
      source.erase(source.begin() + i, source.begin() + k);
      target.insert(target.begin() + place, part.begin(), part.end());
    }
    solution_.set_route(a, first);
    solution_.set_route(b, second);
  }

  enum Kind { kReverse, kSwapParts, kTurnFirst, kTurnSecond, kMoveTo, kMoveToTurned, kMoveFrom,
              kMoveFromTurned, kExchange, kTails };

  Solution& solution_;
  const Problem& problem_;
  Watch& watch_;
  const std::vector<int> uavs_;
  std::vector<std::uint8_t> dirty_;
  double least_ = 0.0;
  int kind_ = 0;
  std::array<int, 3> at_{};
  std::vector<Segment> tails_of_a_, tails_of_b_;
};

}  // namespace

double worth_from(const Solution& solution, int uav, int place, const Segment& middle, int next) {
  const Route& route = solution.route(uav);
  const double survived = solution.survived_before(uav, place);
  const bool ends = next == static_cast<int>(route.size());
  if (middle.empty()) {
    if (ends) return 0.0;
    const double delay_s =
        solution.reach_s(uav, place, route[next]) - solution.completion_s(uav, next);
    return survived * (solution.tail_worth(uav, next) - delay_s * solution.tail_slope(uav, next));
  }
  const double begin_s = solution.reach_s(uav, place, middle.first);
  double worth = middle.worth(begin_s);
  if (!ends) {
    const double delay_s = begin_s + middle.duration_s +
                           solution.problem().leg_s(uav, middle.last, route[next]) -
                           solution.completion_s(uav, next);
    worth += middle.survival *
             (solution.tail_worth(uav, next) - delay_s * solution.tail_slope(uav, next));
  }
  return survived * worth;
}

void improve(Solution& solution, const std::vector<int>& uavs, Watch& watch) {
  LocalSearch(solution, uavs, watch).run();
}

}  // namespace peckorder
