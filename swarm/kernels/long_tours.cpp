// Beam search and local search over complete tours; see long_tours.hpp.
#include "long_tours.hpp"

#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <tuple>
#include <utility>

#include "arrays.hpp"
#include "bindings.hpp"

namespace peckorder {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kWidestBeam = 64;
constexpr std::int64_t kBeamWork = 1'000'000;  // legs the beam may look at, all steps together
constexpr std::int64_t kMoves = 500'000;       // moves the local search may look at
constexpr double kWorthwhile = 1e-12;          // a smaller gain is rounding and could go in circles

using Size = std::size_t;

// Tasks toured one after another: worth constant − slope · τ if the first is completed at τ, the last
// completed `lasting` later; joined in constant time.
struct Segment {
    int first = -1, last = -1;  // -1: empty
    double constant = 0.0, slope = 0.0, lasting = 0.0, survival = 1.0;
};

class LocalSearch {
  public:
    explicit LocalSearch(const TourProblem& problem, std::vector<int> order)
        : p_(problem), n_(problem.n), order_(std::move(order)) {
        rebuild();
    }

    void run() {
        bool improved = true;
        while (improved && looked_ < kMoves) {
            improved = false;
            for (int at = 0; at < n_ && looked_ < kMoves; ++at) improved = improve_at(at) || improved;
        }
    }

    const std::vector<int>& order() const { return order_; }

    // The best worth near by of a tour that begins otherwise.
    double second() const {
        double best = -kInfinity;
        Segment turned = single(order_[0]), between;
        for (int to = 1; to < n_; ++to) {
            turned = join(single(order_[Size(to)]), turned);
            best = std::max(best, worth(join(turned, after_[Size(to) + 1])));
            const Segment alone = join(single(order_[Size(to)]), before_[Size(to)]);
            best = std::max(best, worth(join(alone, after_[Size(to) + 1])));
            if (to + 1 < n_) {
                Segment pair = join(single(order_[Size(to)]), single(order_[Size(to) + 1]));
                pair = join(pair, before_[Size(to)]);
                best = std::max(best, worth(join(pair, after_[Size(to) + 2])));
            }
            between = join(between, single(order_[Size(to)]));
            const Segment later = join(between, single(order_[0]));
            best = std::max(best, worth(join(later, after_[Size(to) + 1])));
        }
        return best;
    }

  private:
    struct Move {  // order without [from, from + count), which goes to `to` there, turned or not;
                   // count 0: a reversal of [from, to]; count -1: from and to change places
        double value;
        int from, count, to;
        bool turned;
    };

    Segment single(int task) const {
        const double w = p_.weight[task];
        return {task, task, w * p_.horizon_s, w, 0.0, p_.survival[task]};
    }

    Segment join(const Segment& a, const Segment& b) const {
        if (a.first < 0) return b;
        if (b.first < 0) return a;
        const double gap = a.lasting + p_.leg_s[Size(a.last) * Size(n_) + Size(b.first)];
        return {a.first,
                b.last,
                a.constant + a.survival * (b.constant - b.slope * gap),
                a.slope + a.survival * b.slope,
                gap + b.lasting,
                a.survival * b.survival};
    }

    double worth(const Segment& tour) const {
        return tour.constant - tour.slope * p_.completion_s[tour.first];
    }

    void rebuild() {
        before_.assign(Size(n_) + 1, {});
        after_.assign(Size(n_) + 1, {});
        for (int i = 0; i < n_; ++i) {
            before_[Size(i) + 1] = join(before_[Size(i)], single(order_[Size(i)]));
        }
        for (int i = n_ - 1; i >= 0; --i) {
            after_[Size(i)] = join(single(order_[Size(i)]), after_[Size(i) + 1]);
        }
        value_ = tour_value(p_, order_);
    }

    void offer(Move& best, const Segment& tour, int from, int count, int to, bool turned) {
        ++looked_;
        const double value = worth(tour);
        if (value > best.value) best = {value, from, count, to, turned};
    }

    bool improve_at(int at) {
        Move best{value_ + kWorthwhile * std::abs(value_), -1, 0, 0, false};
        reversals_and_swaps(best, at);
        for (int count = 1; count <= 3 && at + count <= n_; ++count) {
            Segment block, turned;
            for (int i = at; i < at + count; ++i) {
                block = join(block, single(order_[Size(i)]));
                turned = join(single(order_[Size(i)]), turned);
            }
            block_moves(best, at, count, block, false);
            if (count > 1) block_moves(best, at, count, turned, true);
        }
        if (best.from < 0) return false;
        apply(best);
        const double before = value_;
        rebuild();
        return value_ > before;
    }

    void reversals_and_swaps(Move& best, int at) {
        Segment turned = single(order_[Size(at)]), between;
        const Segment here = turned;
        for (int to = at + 1; to < n_; ++to) {
            const Segment there = single(order_[Size(to)]);
            turned = join(there, turned);
            const Segment& rest = after_[Size(to) + 1];
            offer(best, join(join(before_[Size(at)], turned), rest), at, 0, to, false);
            if (to > at + 2) {  // nearer ones are reversals
                Segment swapped = join(join(before_[Size(at)], there), between);
                offer(best, join(join(swapped, here), rest), at, -1, to, false);
            }
            between = join(between, there);
        }
    }

    void block_moves(Move& best, int at, int count, const Segment& block, bool turned) {
        Segment between;
        for (int to = at + count; to < n_; ++to) {
            between = join(between, single(order_[Size(to)]));
            Segment tour = join(join(before_[Size(at)], between), block);
            offer(best, join(tour, after_[Size(to) + 1]), at, count, to - count + 1, turned);
        }
        between = {};
        for (int to = at - 1; to >= 0; --to) {
            between = join(single(order_[Size(to)]), between);
            Segment tour = join(join(before_[Size(to)], block), between);
            offer(best, join(tour, after_[Size(at + count)]), at, count, to, turned);
        }
    }

    void apply(const Move& move) {
        const auto begin = order_.begin();
        if (move.count < 0) {
            std::swap(order_[Size(move.from)], order_[Size(move.to)]);
        } else if (move.count == 0) {
            std::reverse(begin + move.from, begin + move.to + 1);
        } else {
            std::vector<int> block(begin + move.from, begin + move.from + move.count);
            if (move.turned) std::reverse(block.begin(), block.end());
            order_.erase(begin + move.from, begin + move.from + move.count);
            order_.insert(order_.begin() + move.to, block.begin(), block.end());
        }
    }

    const TourProblem& p_;
    int n_;
    std::vector<int> order_;
    std::vector<Segment> before_, after_;  // [i]: tasks before place i; from place i on
    double value_ = 0.0;
    std::int64_t looked_ = 0;
};

struct Partial {  // a tour under way
    std::vector<int> order;
    std::vector<std::uint8_t> done;
    double free_s, earned, survived, waiting;
    std::uint64_t visited;  // tells sets of tasks apart
};

std::uint64_t mark_of(int task) {
    std::uint64_t mark = (static_cast<std::uint64_t>(task) + 1) * 0x9E3779B97F4A7C15ULL;
    mark ^= mark >> 29;
    return mark * 0x9E3779B97F4A7C15ULL;
}

struct Growth {
    double bound;
    int row, task;
};

// Best bounds first; NaN, which only overflowing input gives, last.
bool better(const Growth& a, const Growth& b) {
    const double x = a.bound == a.bound ? a.bound : -kInfinity;
    const double y = b.bound == b.bound ? b.bound : -kInfinity;
    if (x != y) return x > y;
    return a.row != b.row ? a.row < b.row : a.task < b.task;
}

// Grow many tours task by task; keep those whose bound is best: what is earned plus what the open
// tasks would earn if all were done at once, so that a detour costs its time × all that waits.
// Of those that have visited the same set and end at the same task, only the best stays.
std::vector<Partial> beam(const TourProblem& p) {
    const int n = p.n;
    const std::int64_t square = static_cast<std::int64_t>(n) * n;
    const Size width = Size(std::clamp<std::int64_t>(kBeamWork / square, 1, kWidestBeam));
    double all = 0.0;
    for (int i = 0; i < n; ++i) all += p.weight[i];
    std::vector<Partial> rows(1), grown;
    rows[0] = {{}, std::vector<std::uint8_t>(Size(n), 0), 0.0, 0.0, 1.0, all, 0};
    std::vector<Growth> growths;
    for (int step = 0; step < n; ++step) {
        growths.clear();
        for (int r = 0; r < static_cast<int>(rows.size()); ++r) {
            const Partial& row = rows[Size(r)];
            const double* leg = step ? p.leg_s + Size(row.order.back()) * Size(n) : p.completion_s;
            for (int task = 0; task < n; ++task) {
                if (row.done[Size(task)]) continue;
                const double left_s = p.horizon_s - (row.free_s + leg[task]);
                const double gain = row.survived * p.weight[task] * left_s;
                const double after =
                    (row.waiting - p.weight[task]) * (row.survived * p.survival[task]) * left_s;
                growths.push_back({row.earned + gain + after, r, task});
            }
        }
        const Size head = std::min(growths.size(), 2 * width);
        std::partial_sort(growths.begin(), growths.begin() + static_cast<std::ptrdiff_t>(head),
                          growths.end(), better);
        grown.clear();
        for (Size i = 0; i < head && grown.size() < width; ++i) {
            const Growth& growth = growths[i];
            const Partial& row = rows[Size(growth.row)];
            const std::uint64_t visited = row.visited + mark_of(growth.task);
            const bool known = std::any_of(grown.begin(), grown.end(), [&](const Partial& other) {
                return other.visited == visited && other.order.back() == growth.task;
            });
            if (known) continue;
            const Size task = Size(growth.task);
            const double* leg = step ? p.leg_s + Size(row.order.back()) * Size(n) : p.completion_s;
            Partial next = row;
            next.free_s += leg[task];
            next.earned += row.survived * p.weight[task] * (p.horizon_s - next.free_s);
            next.survived *= p.survival[task];
            next.waiting -= p.weight[task];
            next.visited = visited;
            next.done[task] = 1;
            next.order.push_back(growth.task);
            grown.push_back(std::move(next));
        }
        std::swap(rows, grown);
    }
    return rows;
}

}  // namespace

double tour_value(const TourProblem& p, const std::vector<int>& order) {
    double value = 0.0, survived = 1.0, time_s = 0.0;
    for (Size i = 0; i < order.size(); ++i) {
        const Size task = Size(order[i]);
        time_s = i ? time_s + p.leg_s[Size(order[i - 1]) * Size(p.n) + task] : p.completion_s[task];
        value += survived * p.weight[task] * (p.horizon_s - time_s);
        survived *= p.survival[task];
    }
    return value;
}

GoodTour good_tour(const TourProblem& problem) {
    const std::vector<Partial> tours = beam(problem);
    std::vector<double> values;
    for (const Partial& tour : tours) values.push_back(tour_value(problem, tour.order));
    const Size best = Size(std::max_element(values.begin(), values.end()) - values.begin());
    LocalSearch search(problem, tours[best].order);
    search.run();
    GoodTour found{search.order(), 0.0, search.second()};
    found.value = tour_value(problem, found.order);
    for (Size i = 0; i < tours.size(); ++i) {
        if (tours[i].order[0] != found.order[0]) found.second = std::max(found.second, values[i]);
    }
    return found;
}

void bind_long_tours(nb::module_& module) {
    module.def(
        "good_tour",
        [](In<double, 1> completion_s, In<double, 1> weight, In<double, 1> survival,
           In<double, 2> leg_s,
           double horizon_s) -> std::tuple<Out<std::int64_t, 1>, double, double> {
            const Size n = completion_s.shape(0);
            if (n < 2 || n > 4096) refuse("completion_s must name 2..4096 tasks");
            require_shape("weight", weight, {n});
            require_shape("survival", survival, {n});
            require_shape("leg_s", leg_s, {n, n});
            require_finite("completion_s", completion_s.data(), n);
            require_finite("weight", weight.data(), n);
            require_finite("survival", survival.data(), n);
            require_finite("leg_s", leg_s.data(), n * n);
            require_finite("horizon_s", &horizon_s, 1);
            const TourProblem problem{static_cast<int>(n), horizon_s,       completion_s.data(),
                                      weight.data(),       survival.data(), leg_s.data()};
            GoodTour tour;
            {
                nb::gil_scoped_release released;
                tour = good_tour(problem);
            }
            std::vector<std::int64_t> order(tour.order.begin(), tour.order.end());
            return {give(std::move(order)), tour.value, tour.second};
        },
        nb::arg("completion_s").noconvert(), nb::arg("weight").noconvert(), nb::arg("survival").noconvert(), nb::arg("leg_s").noconvert(),
        nb::arg("horizon_s"));
}

}  // namespace peckorder
