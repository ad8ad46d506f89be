// Greedy (eq. 7), lookahead (eq. 6, 8) and the certificate of Theorem 5; see rules.hpp.
#include "rules.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "long_tours.hpp"

#if defined(_MSC_VER)
#define PECKORDER_RESTRICT __restrict
#else
#define PECKORDER_RESTRICT __restrict__
#endif

namespace peckorder {

namespace {

using Size = std::size_t;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr Size kTableBytes = 16u << 20;  // tour tables a workspace keeps
constexpr Size kLongestTour = 512;       // tasks lookahead tours beyond kExactTasks

constexpr Size kBlock = 128;             // tasks looked at together, so that they stay in cache

// Four running maxima, so that the processor need not wait for one.
double largest(const double* v, Size n) {
    double m0 = -kInfinity, m1 = m0, m2 = m0, m3 = m0;
    Size i = 0;
    for (; i + 4 <= n; i += 4) {
        m0 = v[i] > m0 ? v[i] : m0;
        m1 = v[i + 1] > m1 ? v[i + 1] : m1;
        m2 = v[i + 2] > m2 ? v[i + 2] : m2;
        m3 = v[i + 3] > m3 ? v[i + 3] : m3;
    }
    for (; i < n; ++i) m0 = v[i] > m0 ? v[i] : m0;
    return std::max(std::max(m0, m1), std::max(m2, m3));
}

// The first of the largest; 0 if none is above -infinity.
Size argmax(const std::vector<double>& values, Size n) {
    const double most = largest(values.data(), n);
    for (Size i = 0; i < n; ++i) {
        if (values[i] == most) return i;
    }
    return 0;
}

// Told that no two arrays overlap, compilers do two tasks or more at once.
template <typename Legs>
void score_along(const Legs legs, Size n, const double* PECKORDER_RESTRICT x_m,
                 const double* PECKORDER_RESTRICT y_m, const double* PECKORDER_RESTRICT z_m,
                 const double* PECKORDER_RESTRICT service_s,
                 const double* PECKORDER_RESTRICT weight, const Decider& decider,
                 const Problem& problem, double* PECKORDER_RESTRICT completion_s,
                 double* PECKORDER_RESTRICT score) {
    const double free_s = decider.free_s, survived = decider.survived;
    const double horizon_s = problem.horizon_s();
    for (Size i = 0; i < n; ++i) {
        const double time_s = (free_s + legs.travel_s(x_m[i], y_m[i], z_m[i])) + service_s[i];
        completion_s[i] = time_s;
        score[i] = (horizon_s - time_s) * (survived * weight[i]);
    }
}

void score_all(Size n, const double* x_m, const double* y_m, const double* z_m,
               const double* service_s, const double* weight, const Decider& decider,
               const Problem& problem, double* completion_s, double* score) {
    problem.with_legs_from(decider.uav, decider.place_m, [&](const auto& legs) {
        score_along(legs, n, x_m, y_m, z_m, service_s, weight, decider, problem, completion_s,
                    score);
    });
}

// -infinity if there is no other.
double largest_but(const std::vector<double>& values, Size n, Size left_out) {
    double most = -kInfinity;
    for (Size i = 0; i < n; ++i) {
        if (i != left_out && values[i] > most) most = values[i];
    }
    return most;
}

}  // namespace

void OpenTasks::assign(const Problem& problem, const std::uint8_t* open) {
    task.clear();
    for (int t = 0; t < problem.n_task(); ++t) {
        if (open[t]) task.push_back(t);
    }
    const Size n = task.size();
    x_m.resize(n);
    y_m.resize(n);
    z_m.resize(n);
    service_s.resize(n);
    for (Size i = 0; i < n; ++i) {
        const double* place_m = problem.place_m(task[i]);
        x_m[i] = place_m[0];
        y_m[i] = place_m[1];
        z_m[i] = place_m[2];
        service_s[i] = problem.service_s(task[i]);
    }
}

void OpenTasks::assign_capable(const Problem& problem, const OpenTasks& all, int uav) {
    const std::uint8_t* capable = problem.abilities(uav);
    const Size most = all.size();
    task.resize(most);
    x_m.resize(most);
    y_m.resize(most);
    z_m.resize(most);
    service_s.resize(most);
    Size n = 0;
    for (Size i = 0; i < most; ++i) {
        task[n] = all.task[i];
        x_m[n] = all.x_m[i];
        y_m[n] = all.y_m[i];
        z_m[n] = all.z_m[i];
        service_s[n] = all.service_s[i];
        n += capable[all.task[i]] ? 1 : 0;
    }
    task.resize(n);
    x_m.resize(n);
    y_m.resize(n);
    z_m.resize(n);
    service_s.resize(n);
}

void OpenTasks::remove(Size place) {
    const auto at = static_cast<std::ptrdiff_t>(place);
    task.erase(task.begin() + at);
    x_m.erase(x_m.begin() + at);
    y_m.erase(y_m.begin() + at);
    z_m.erase(z_m.begin() + at);
    service_s.erase(service_s.begin() + at);
}

void OpenTasks::remove_task(int which) {
    const auto at = std::lower_bound(task.begin(), task.end(), which);
    remove(static_cast<Size>(at - task.begin()));
}

Choice Workspace::decide(const Problem& problem, const OpenTasks& all, const Decider& decider,
                         RuleCode rule, bool brief) {
    tasks_ = &all;
    if (!problem.capable_of_all(decider.uav)) {
        capable_.assign_capable(problem, all, decider.uav);
        tasks_ = &capable_;
    }
    if (tasks_->empty()) return {};
    if (rule == RuleCode::kGreedy && brief) return decide_briefly(problem, decider);
    look_out(problem, decider);
    const Size n = tasks_->size();
    if (rule == RuleCode::kGreedy || n == 1) return decide_greedily(problem, decider);
    return n <= kExactTasks ? look_ahead(problem, decider) : look_ahead_far(problem, decider);
}

// When each task would be complete if taken next, and its greedy score S·p·m·(D − t).
void Workspace::look_out(const Problem& problem, const Decider& decider) {
    const OpenTasks& tasks = *tasks_;
    const Size n = tasks.size();
    completion_s_.resize(n);
    score_.resize(n);
    weight_.resize(n);
    const double* row = problem.weights(decider.uav);
    for (Size i = 0; i < n; ++i) weight_[i] = row[tasks.task[i]];
    score_all(n, tasks.x_m.data(), tasks.y_m.data(), tasks.z_m.data(), tasks.service_s.data(),
              weight_.data(), decider, problem, completion_s_.data(), score_.data());
}

// Greedy without second and certificate: nothing is kept of a block but its best task.
Choice Workspace::decide_briefly(const Problem& problem, const Decider& decider) {
    const OpenTasks& tasks = *tasks_;
    const Size n = tasks.size();
    const double* row = problem.weights(decider.uav);
    double weight[kBlock], completion_s[kBlock], score[kBlock];
    Choice choice;
    choice.score = -kInfinity;
    for (Size from = 0; from < n; from += kBlock) {
        const Size count = std::min(n - from, kBlock);
        const std::int32_t* task = tasks.task.data() + from;
        for (Size i = 0; i < count; ++i) weight[i] = row[task[i]];
        score_all(count, tasks.x_m.data() + from, tasks.y_m.data() + from, tasks.z_m.data() + from,
                  tasks.service_s.data() + from, weight, decider, problem, completion_s, score);
        const double most = largest(score, count);
        // the very first task is taken where no score is above -infinity
        if (!(most > choice.score) && choice.task >= 0) continue;
        Size i = 0;
        while (i < count && score[i] != most) ++i;
        if (i == count) i = 0;
        choice.task = task[i];
        choice.completion_s = completion_s[i];
        choice.score = most;
    }
    return choice;
}

Choice Workspace::decide_greedily(const Problem& problem, const Decider& decider) {
    const Size n = tasks_->size(), best = argmax(score_, n);
    values_ = &score_;
    Choice choice;
    choice.task = tasks_->task[best];
    choice.completion_s = completion_s_[best];
    choice.score = score_[best];
    choice.has_second = n > 1;
    if (choice.has_second) choice.second = largest_but(score_, n, best);
    choice.certificate = certificate(problem, decider, best, choice.second);
    return choice;
}

Choice Workspace::look_ahead(const Problem& problem, const Decider& decider) {
    const Size n = tasks_->size();
    const Table& known = table(problem, decider.uav);
    double completion_s[kExactTasks] = {}, values[kExactTasks];
    std::uint32_t mask = 0;
    Size place[kExactTasks];
    for (Size i = 0, at = 0; i < n; ++i, ++at) {
        while (known.tasks[at] != tasks_->task[i]) ++at;
        place[i] = at;
        mask |= std::uint32_t{1} << at;
        completion_s[at] = completion_s_[i];
    }
    known.tours->first_values(mask, completion_s, values);
    std::vector<double>& worth = tour_completion_s_;
    worth.resize(n);
    values_ = &worth;
    for (Size i = 0; i < n; ++i) worth[i] = values[place[i]] * decider.survived;
    const Size greedy = argmax(score_, n);
    Choice choice;
    choice.certificate = certificate(problem, decider, greedy, largest_but(score_, n, greedy));
    // where Theorem 5 settles the choice, rounding in the tours' sums must not
    const Size best = choice.certificate ? greedy : argmax(worth, n);
    choice.task = tasks_->task[best];
    choice.completion_s = completion_s_[best];
    choice.score = worth[best];
    choice.second = largest_but(worth, n, best);
    choice.has_second = true;
    return choice;
}

Choice Workspace::look_ahead_far(const Problem& problem, const Decider& decider) {
    const OpenTasks& tasks = *tasks_;
    values_ = nullptr;
    picked_.resize(tasks.size());
    std::iota(picked_.begin(), picked_.end(), 0);
    if (picked_.size() > kLongestTour) {  // those worth most per time spent, in ascending order
        auto rate = [&](std::int32_t i) {
            const double spent_s = completion_s_[static_cast<Size>(i)] - decider.free_s;
            const double per_s = weight_[static_cast<Size>(i)] / (spent_s + 1e-9);
            return per_s == per_s ? per_s : 0.0;
        };
        std::sort(picked_.begin(), picked_.end(), [&](std::int32_t a, std::int32_t b) {
            const double x = rate(a), y = rate(b);
            return x != y ? x > y : a < b;
        });
        picked_.resize(kLongestTour);
        std::sort(picked_.begin(), picked_.end());
    }
    const Size n = picked_.size();
    std::vector<double> weight(n);
    std::vector<int> toured(n);
    tour_completion_s_.resize(n);
    tour_survival_.resize(n);
    for (Size i = 0; i < n; ++i) {
        const Size at = static_cast<Size>(picked_[i]);
        toured[i] = tasks.task[at];
        weight[i] = weight_[at];
        tour_completion_s_[i] = completion_s_[at];
        tour_survival_[i] = problem.survivals(decider.uav)[tasks.task[at]];
    }
    const std::vector<double> leg_s = problem.legs_s(decider.uav, toured);
    const GoodTour tour = good_tour({static_cast<int>(n), problem.horizon_s(),
                                     tour_completion_s_.data(), weight.data(),
                                     tour_survival_.data(), leg_s.data()});
    const Size all = tasks.size(), greedy = argmax(score_, all);
    Size best = static_cast<Size>(picked_[static_cast<Size>(tour.order[0])]);
    double value = tour.value, second = tour.second;
    Choice choice;
    choice.certificate = certificate(problem, decider, greedy, largest_but(score_, all, greedy));
    if (choice.certificate && greedy != best) {
        best = greedy;
        std::swap(value, second);
    }
    choice.task = tasks.task[best];
    choice.completion_s = completion_s_[best];
    choice.score = decider.survived * value;
    choice.second = decider.survived * second;
    choice.has_second = true;
    choice.exact = choice.certificate;
    return choice;
}

std::vector<std::pair<int, double>> Workspace::valued(const Choice& choice, Size most) const {
    std::vector<std::pair<int, double>> found{{choice.task, choice.score}};
    if (!values_) return found;
    for (Size i = 0; i < tasks_->size(); ++i) {
        if (tasks_->task[i] != choice.task) found.emplace_back(tasks_->task[i], (*values_)[i]);
    }
    const auto last = found.begin() + static_cast<std::ptrdiff_t>(std::min(most, found.size()));
    std::partial_sort(found.begin() + 1, last, found.end(), [](const auto& a, const auto& b) {
        return a.second != b.second ? a.second > b.second : a.first < b.first;
    });
    found.erase(last, found.end());
    return found;
}

// Theorem 5: p̄ <= (1 − λ)/(2 − λ), and some tour that begins greedily is worth its first task.
// Of legs the proof uses only that no task is complete later than by way of another, so it covers
// acceleration, too: see Ramps.
bool Workspace::certificate(const Problem& problem, const Decider& decider, Size best,
                            double second) {
    const Size n = tasks_->size();
    if (n == 1) return true;  // one tour only
    const double first = score_[best];
    if (!(first > 0.0)) return false;
    const double* survival = problem.survivals(decider.uav);
    double highest = 0.0;
    for (Size i = 0; i < n; ++i) highest = std::max(highest, survival[tasks_->task[i]]);
    if (highest > 0.5) return false;  // (1 − λ)/(2 − λ) is at most 1/2 for λ within 0..1
    const double ratio = std::max(0.0, second / first);
    if (highest * (2.0 - ratio) > 1.0 - ratio) return false;
    return rest_is_worth_flying(problem, decider, best);
}

// Whether the tour that always goes to the best greedy score next earns >= 0 after its first task.
bool Workspace::rest_is_worth_flying(const Problem& problem, const Decider& decider, Size best) {
    std::vector<Size> left(tasks_->size());
    std::iota(left.begin(), left.end(), Size{0});
    const double* survival = problem.survivals(decider.uav);
    double free_s = completion_s_[best], earned = 0.0, survived = 1.0;
    Size at = best;
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(best));
    while (!left.empty() && survived > 0.0) {
        Size chosen = 0;
        double most = -kInfinity, time_s = free_s;
        for (Size k = 0; k < left.size(); ++k) {
            const Size i = left[k];
            const double travel_s = problem.travel_s(decider.uav, tasks_->task[at], tasks_->task[i]);
            const double t = (free_s + travel_s) + tasks_->service_s[i];
            const double score = weight_[i] * (problem.horizon_s() - t);
            if (score > most) {
                most = score;
                chosen = k;
                time_s = t;
            }
        }
        at = left[chosen];
        earned += survived * most;
        survived *= survival[tasks_->task[at]];
        free_s = time_s;
        left.erase(left.begin() + static_cast<std::ptrdiff_t>(chosen));
    }
    return earned >= 0.0;
}

// A table over the decider's tasks or more of them.
const Workspace::Table& Workspace::table(const Problem& problem, int uav) {
    const std::vector<std::int32_t>& wanted = tasks_->task;
    tables_.resize(static_cast<Size>(problem.n_uav()));
    Table& known = tables_[static_cast<Size>(uav)];
    if (known.tours && std::includes(known.tasks.begin(), known.tasks.end(), wanted.begin(),
                                     wanted.end())) {
        return known;
    }
    if (known.tours) table_bytes_ -= known.tours->bytes();
    known.tours.reset();
    if (table_bytes_ > kTableBytes) {
        for (Table& other : tables_) other.tours.reset();
        table_bytes_ = 0;
    }
    const Size n = wanted.size();
    std::vector<double> weight(n), survival(n);
    for (Size i = 0; i < n; ++i) {
        weight[i] = problem.weights(uav)[wanted[i]];
        survival[i] = problem.survivals(uav)[wanted[i]];
    }
    const std::vector<double> leg_s = problem.legs_s(uav, wanted);
    known.tasks = wanted;
    Watch never;
    known.tours = std::make_unique<TourTable>(static_cast<int>(n), weight.data(), survival.data(),
                                              leg_s.data(), problem.horizon_s(), never);
    table_bytes_ += known.tours->bytes();
    return known;
}

}  // namespace peckorder
