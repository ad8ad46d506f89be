// The proven optimum of the field's problem: by (fewest tasks without due_s left out, largest J).
//
// Without bases that have too few slots: the best lists of each UAV for every set of tasks
// (field_labels.hpp), then dynamic programming over the division of the tasks.
//
// Where slots are few, UAVs delay each other, and a delay may even help: who begins a sortie later
// waits less in the air for a task to open. So the same is first done with relaxed lists, which
// nobody delays and behind whose bases waiting in the air costs no energy: never worse than what can
// be flown. Then divisions are gone through, best first, down to what has been found; of each the
// combinations of lists, best first; and each combination is flown.
#include "field_exact.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "field_team.hpp"
#include "parallel.hpp"

namespace peckorder {

namespace {

using Size = std::size_t;

constexpr double kRounding = 1e-9;  // J: so much better is better
constexpr std::int64_t kSubsetsPerStep = 8;  // of a Watch
constexpr Size kMostChoices = 1'000'000;     // lists of one UAV that are held at once
constexpr int kMostAtOnce = 2;               // UAVs whose labels are held at once
constexpr double kEndless = std::numeric_limits<double>::infinity();

int count_of(TaskSet set) {
    int count = 0;
    for (; set; set &= set - 1) ++count;
    return count;
}

// A list and what it is worth if nobody delays it.
struct Choice {
    double bound;
    FieldList list;
};

// Of one UAV and one set: the lists that may be worth more than `above`, best first.
struct Choices {
    double above = kEndless;  // nothing looked at yet
    std::vector<Choice> lists;
};

// All lists of a set that visit a base with few slots, one by one.
class SharedLists {
  public:
    SharedLists(const OwnQuestion& question, TaskSet set, bool always_shared, double above,
                Watch& watch, std::vector<Choice>& found)
        : question_(question), problem_(*question.problem), always_shared_(always_shared),
          above_(above), watch_(watch), found_(found) {
        for (Size i = 0; i < question.tasks.size(); ++i) {
            if (set >> i & 1) left_.push_back(question.tasks[i]);
        }
        for (const int task : left_) least_leg_s_.push_back(least_leg_s(task));
    }

    // Whether all of them fit in memory.
    bool collect() {
        grow(question_.begin, always_shared_, false, question_.landed_at, 0);
        return !full_;
    }

  private:
    double least_leg_s(int task) const {
        double least_s = kEndless;
        const int uav = question_.uav;
        for (int back = 0; back < 2; ++back) {
            const int enter = problem_.enter_node(item_of_task(task, back));
            least_s = std::min(least_s, question_.begin.legs_s[enter]);
            for (int base = 0; base < problem_.n_base; ++base) {
                least_s =
                    std::min(least_s, problem_.legs_from(uav, problem_.base_node(base))[enter]);
            }
            for (const int other : left_) {
                for (int way = 0; way < 2 && other != task; ++way) {
                    const int leave = problem_.leave_node(item_of_task(other, way));
                    least_s = std::min(least_s, problem_.legs_from(uav, leave)[enter]);
                }
            }
        }
        return least_s;
    }

    // Of any list that begins like this; kImpossible if none can be flown.
    double bound(const Progress& progress) const {
        double bound = progress.value;
        for (Size i = 0; i < left_.size(); ++i) {
            const int task = left_[i];
            if (done_ >> i & 1) continue;
            const double begin_s =
                std::max(progress.time_s + least_leg_s_[i], problem_.opens_s[task]);
            if (begin_s > problem_.closes_s[task] + 2.0 * kToleranceS) return kImpossible;
            const double line_s =
                std::min(problem_.line_time_s(question_.uav, item_of_task(task, 0)),
                         problem_.line_time_s(question_.uav, item_of_task(task, 1)));
            const double end_s = begin_s + line_s + problem_.service_s[task];
            if (end_s > problem_.due_s[task] + 2.0 * kToleranceS) return kImpossible;
            const double weight = problem_.weight[problem_.at(question_.uav, task)];
            bound += progress.survived * weight * std::max(0.0, problem_.until_s[task] - end_s);
        }
        return bound;
    }

    void grow(const Progress& from, bool shared, bool delayed, int here, int row) {
        if (full_ || watch_.stops_after(10)) return;
        if (done_ + 1 == TaskSet{1} << left_.size()) {
            if (!shared || from.value <= above_) return;
            if (found_.size() >= kMostChoices) full_ = true;
            found_.push_back({from.value, list_});
            return;
        }
        const double most = bound(from);
        if (most == kImpossible || most + kRounding <= above_) return;
        for (Size i = 0; i < left_.size(); ++i) {
            if (done_ >> i & 1) continue;
            for (int back = 0; back <= problem_.is_line[left_[i]]; ++back) {
                Progress progress = from;
                bool behind = delayed;
                const Item item = item_of_task(left_[i], back);
                if (!extend_relaxed(question_, item, behind, progress)) continue;
                done_ |= TaskSet{1} << i;
                list_.push_back(item);
                grow(progress, shared, behind, -1, 0);
                list_.pop_back();
                done_ &= ~(TaskSet{1} << i);
            }
        }
        if (!question_.swaps() || row >= question_.most_in_a_row()) return;
        for (int base = 0; base < problem_.n_base; ++base) {
            Progress progress = from;
            bool behind = delayed;
            const Item item = item_of_base(base);
            if (base == here || !extend_relaxed(question_, item, behind, progress)) continue;
            const bool few = question_.base_use[base] == BaseUse::kRelaxed;
            list_.push_back(item);
            grow(progress, shared || few, behind, base, row + 1);
            list_.pop_back();
        }
    }

    const OwnQuestion& question_;
    const FieldProblem& problem_;
    const bool always_shared_;
    const double above_;
    Watch& watch_;
    std::vector<Choice>& found_;
    std::vector<int> left_;
    std::vector<double> least_leg_s_;
    TaskSet done_ = 0;
    FieldList list_;
    bool full_ = false;
};

// Best sums of values over all divisions of every set among the first UAVs of some.
class Division {
  public:
    Division(const std::vector<std::unique_ptr<OwnLists>>& own, Size n_set, int threads,
             Watch& watch)
        : own_(own) {
        for (Size j = 0; j < own.size() && !watch.stopped(); ++j) {
            best_.emplace_back(n_set);
            parallel_for(n_set, threads, 256, [&] {
                return [&](Size job) {
                    const auto set = static_cast<TaskSet>(job);
                    if (!watch.stopped()) best_[j][set] = best_of(static_cast<int>(j), set, watch);
                };
            });
        }
    }

    // Exactly `set`, among UAVs 0..last; -1: nobody.
    double value(int last, TaskSet set) const {
        if (last < 0) return set ? kImpossible : 0.0;
        return best_[static_cast<Size>(last)][set];
    }

    // The subset for UAV `last` where the rest goes to those before it.
    TaskSet part(int last, TaskSet set) const {
        TaskSet chosen = 0;
        double most = kImpossible;
        for (TaskSet s = set;; s = (s - 1) & set) {
            const double worth = value(last - 1, set ^ s) + own_[static_cast<Size>(last)]->value(s);
            if (worth > most) {
                most = worth;
                chosen = s;
            }
            if (!s) return chosen;
        }
    }

  private:
    double best_of(int j, TaskSet set, Watch& watch) const {
        const OwnLists& own = *own_[static_cast<Size>(j)];
        if (j == 0) return own.value(set);
        double most = kImpossible;
        std::int64_t looked = 0;
        for (TaskSet s = set;; s = (s - 1) & set) {
            const double mine = own.value(s);
            if (mine != kImpossible) most = std::max(most, value(j - 1, set ^ s) + mine);
            ++looked;
            if (!s) break;
        }
        watch.stops_after(looked / kSubsetsPerStep + 1);
        return most;
    }

    const std::vector<std::unique_ptr<OwnLists>>& own_;
    std::vector<std::vector<double>> best_;
};

class Proof {
  public:
    Proof(const FieldProblem& problem, const FieldTeam& team, int threads, Watch& watch)
        : problem_(problem), team_(team), threads_(threads), watch_(watch),
          tasks_(tasks_to_divide(problem, team)) {
        best_.lists.resize(static_cast<Size>(problem.n_uav));
        for (int task = 0; task < problem.n_task; ++task) {
            n_required_ += team.open[task] && problem.required[task];
        }
        for (Size i = 0; i < tasks_.size(); ++i) {
            if (problem.required[tasks_[i]]) required_ |= TaskSet{1} << i;
        }
        ask_all();
    }

    FieldOptimum run(const std::vector<FieldList>& known) {
        if (!known.empty()) consider_known(known);
        if (tasks_.size() > static_cast<Size>(kMostOwnTasks)) {
            best_.outcome = Outcome::kTooLarge;
            return best_;
        }
        best_.outcome = find();
        return best_;
    }

  private:
    void ask_all() {
        int n_user = 0;
        for (int uav = 0; uav < problem_.n_uav; ++uav) {
            n_user += std::isfinite(problem_.full_s[uav]) || team_.landed_at[uav] >= 0;
        }
        few_.resize(static_cast<Size>(problem_.n_base));
        for (int base = 0; base < problem_.n_base; ++base) {
            few_[static_cast<Size>(base)] = problem_.slots[base] > 0 && problem_.slots[base] < n_user;
            any_few_ = any_few_ || few_[static_cast<Size>(base)];
        }
        for (int uav = 0; uav < problem_.n_uav; ++uav) {
            if (!team_.active[uav] || !std::isfinite(team_.free_s[uav])) continue;
            OwnQuestion question;
            question.problem = &problem_;
            question.uav = uav;
            question.begin = team_.begin(problem_, uav);
            question.landed_at = team_.landed_at[uav];
            question.tasks = tasks_;
            question.base_use.assign(few_.size(), BaseUse::kFree);
            questions_.push_back(std::move(question));
        }
    }

    Outcome find() {
        const BaseUse few_use = any_few_ ? BaseUse::kForbidden : BaseUse::kFree;
        std::vector<std::unique_ptr<OwnLists>> alone;
        Outcome outcome = set_labels(few_use, alone);
        if (outcome != Outcome::kProven) return outcome;
        const Division apart(alone, n_set(), threads_, watch_);
        if (watch_.stopped()) return Outcome::kStopped;
        consider_division(apart, alone);
        if (!any_few_) return Outcome::kProven;
        std::vector<std::unique_ptr<OwnLists>> relaxed;
        outcome = set_labels(BaseUse::kRelaxed, relaxed);
        if (outcome != Outcome::kProven) return outcome;
        const Division together(relaxed, n_set(), threads_, watch_);
        if (watch_.stopped()) return Outcome::kStopped;
        return go_through(together, relaxed, alone);
    }

    Size n_set() const { return Size{1} << tasks_.size(); }

    Outcome set_labels(BaseUse few_use, std::vector<std::unique_ptr<OwnLists>>& own) {
        for (OwnQuestion& question : questions_) {
            for (Size base = 0; base < few_.size(); ++base) {
                if (few_[base]) question.base_use[base] = few_use;
            }
        }
        own.resize(questions_.size());
        parallel_for(questions_.size(), std::min(threads_, kMostAtOnce), 1, [&] {
            return [&](Size j) {
                own[j] = std::make_unique<OwnLists>(questions_[j], watch_);
            };
        });
        Outcome worst = Outcome::kProven;
        for (const auto& lists : own) worst = std::max(worst, lists->outcome());
        return worst;
    }

    int left_out(TaskSet set) const { return n_required_ - count_of(set & required_); }

    bool better(int n_left_out, double worth) const {
        if (!best_.found || n_left_out != best_.n_left_out) {
            return !best_.found || n_left_out < best_.n_left_out;
        }
        return worth > best_.objective;
    }

    static ItemList view(const FieldList& list) {
        return {list.data(), static_cast<int>(list.size())};
    }

    // J of all lists, waiting for slots included; kImpossible if one of them can't be flown.
    double worth_together(const std::vector<ItemList>& lists) {
        return flights_.fly(problem_, team_, lists.data(), true) ? flights_.value() : kImpossible;
    }

    void keep(int n_left_out, double worth, std::vector<FieldList> lists) {
        best_.found = true;
        best_.n_left_out = n_left_out;
        best_.objective = worth;
        best_.lists = std::move(lists);
    }

    void consider(int n_left_out, std::vector<FieldList> lists) {
        std::vector<ItemList> flown;
        for (const FieldList& list : lists) flown.push_back(view(list));
        const double worth = worth_together(flown);
        if (worth != kImpossible && better(n_left_out, worth)) {
            keep(n_left_out, worth, std::move(lists));
        }
    }

    void consider_known(const std::vector<FieldList>& known) {
        int n_left_out = n_required_;
        for (const FieldList& list : known) {
            for (const Item item : list) {
                n_left_out -= !is_base(item) && problem_.required[task_of(item)];
            }
        }
        consider(n_left_out, known);
    }

    void consider_division(const Division& division,
                           const std::vector<std::unique_ptr<OwnLists>>& own) {
        const int last = static_cast<int>(own.size()) - 1;
        TaskSet best = 0;
        for (TaskSet set = 1; set < n_set(); ++set) {
            const double worth = division.value(last, set);
            if (worth == kImpossible || left_out(set) > left_out(best)) continue;
            if (left_out(set) < left_out(best) || worth > division.value(last, best)) best = set;
        }
        std::vector<FieldList> lists(static_cast<Size>(problem_.n_uav));
        const int n_left_out = left_out(best);
        for (int j = last; j >= 0; --j) {
            const TaskSet part = division.part(j, best);
            lists[static_cast<Size>(questions_[static_cast<Size>(j)].uav)] =
                own[static_cast<Size>(j)]->list(part);
            best ^= part;
        }
        consider(n_left_out, std::move(lists));
    }

    // All divisions that may beat what has been found, best first.
    Outcome go_through(const Division& division,
                       const std::vector<std::unique_ptr<OwnLists>>& relaxed,
                       const std::vector<std::unique_ptr<OwnLists>>& alone) {
        const int last = static_cast<int>(relaxed.size()) - 1;
        std::vector<TaskSet> sets;
        for (TaskSet set = 0; set < n_set(); ++set) {
            if (may_beat(set, division.value(last, set))) sets.push_back(set);
        }
        std::sort(sets.begin(), sets.end(), [&](TaskSet a, TaskSet b) {
            if (left_out(a) != left_out(b)) return left_out(a) < left_out(b);
            const double more = division.value(last, a), less = division.value(last, b);
            return more != less ? more > less : a < b;
        });
        relaxed_ = &relaxed;
        alone_ = &alone;
        division_ = &division;
        parts_.assign(relaxed.size(), 0);
        choices_.assign(relaxed.size(), {});
        for (const TaskSet set : sets) {
            if (!may_beat(set, division.value(last, set))) break;
            divide(last, set, 0.0, set);
            if (too_large_) return Outcome::kTooLarge;
            if (watch_.stopped()) return Outcome::kStopped;
        }
        return Outcome::kProven;
    }

    // What a plan of these tasks must be worth more than.
    double bar(TaskSet all) const {
        return best_.found && best_.n_left_out == left_out(all) ? best_.objective + kRounding
                                                                : kImpossible;
    }

    bool may_beat(TaskSet all, double bound) const {
        if (bound == kImpossible) return false;
        if (best_.found && left_out(all) > best_.n_left_out) return false;
        return bound > bar(all);
    }

    void divide(int j, TaskSet left, double sure, TaskSet all) {
        if (too_large_ || watch_.stopped()) return;
        if (j < 0) {
            combine(all);
            return;
        }
        const OwnLists& own = *(*relaxed_)[static_cast<Size>(j)];
        std::vector<std::pair<double, TaskSet>> parts;
        std::int64_t looked = 0;
        for (TaskSet s = left;; s = (s - 1) & left, ++looked) {
            const double worth = (sure + own.value(s)) + division_->value(j - 1, left ^ s);
            if (may_beat(all, worth)) parts.emplace_back(-worth, s);
            if (!s) break;
        }
        watch_.stops_after(looked / kSubsetsPerStep + 1);
        std::sort(parts.begin(), parts.end());
        for (const auto& [negative, part] : parts) {
            if (!may_beat(all, -negative)) break;
            parts_[static_cast<Size>(j)] = part;
            divide(j - 1, left ^ part, sure + own.value(part), all);
        }
    }

    // All combinations of lists of a division that may beat what has been found.
    void combine(TaskSet all) {
        const Size n = parts_.size();
        double total = 0.0;
        for (Size j = 0; j < n; ++j) total += (*relaxed_)[j]->value(parts_[j]);
        if (!may_beat(all, total)) return;
        std::vector<const std::vector<Choice>*> lists(n);
        for (Size j = 0; j < n; ++j) {
            const double own = (*relaxed_)[j]->value(parts_[j]);
            const double above = bar(all) - (total - own) - kRounding;
            lists[j] = &choices(j, parts_[j], above);
            if (too_large_ || watch_.stopped() || lists[j]->empty()) return;
        }
        std::vector<double> most(n + 1, 0.0);  // of all lists before
        for (Size j = 0; j < n; ++j) most[j + 1] = most[j] + lists[j]->front().bound;
        std::vector<ItemList> chosen(static_cast<Size>(problem_.n_uav));
        fly_combinations(n, 0.0, all, lists, most, chosen);
    }

    void fly_combinations(Size n_left, double sure, TaskSet all,
                          const std::vector<const std::vector<Choice>*>& lists,
                          const std::vector<double>& most, std::vector<ItemList>& chosen) {
        if (n_left == 0) {
            const double worth = worth_together(chosen);
            if (worth == kImpossible || !better(left_out(all), worth)) return;
            std::vector<FieldList> kept;
            for (const ItemList& list : chosen) {
                kept.emplace_back(list.items, list.items + list.count);
            }
            keep(left_out(all), worth, std::move(kept));
            return;
        }
        const Size j = n_left - 1;
        for (const Choice& choice : *lists[j]) {
            const double bound = sure + choice.bound;
            if (watch_.stops_after(20) || !may_beat(all, bound + most[j])) return;
            chosen[static_cast<Size>(questions_[j].uav)] = view(choice.list);
            fly_combinations(j, bound, all, lists, most, chosen);
        }
    }

    // Of UAV j and one set all that may be worth more than `above`, best first.
    const std::vector<Choice>& choices(Size j, TaskSet set, double above) {
        Size held = 0;
        for (const auto& [other, lists] : choices_[j]) held += other == set ? 0 : lists.lists.size();
        if (held > kMostChoices) choices_[j].clear();
        Choices& known = choices_[j][set];
        if (known.above <= above) return known.lists;
        known.above = above;
        known.lists.clear();
        // Who holds a slot from the beginning may be in others' way whatever it does.
        const int stands = questions_[j].landed_at;
        const bool always = stands >= 0 && few_[static_cast<Size>(stands)];
        if (!always && (*alone_)[j]->value(set) > above) {
            known.lists.push_back({(*alone_)[j]->value(set), (*alone_)[j]->list(set)});
        }
        SharedLists shared(questions_[j], set, always, above, watch_, known.lists);
        too_large_ = !shared.collect() || too_large_;
        std::stable_sort(known.lists.begin(), known.lists.end(),
                         [](const Choice& a, const Choice& b) { return a.bound > b.bound; });
        return known.lists;
    }

    const FieldProblem& problem_;
    const FieldTeam& team_;
    const int threads_;
    Watch& watch_;
    const std::vector<int> tasks_;
    TeamFlights flights_;
    TaskSet required_ = 0;
    int n_required_ = 0;
    std::vector<std::uint8_t> few_;  // of each base: others may be in the way
    bool any_few_ = false, too_large_ = false;
    std::vector<OwnQuestion> questions_;  // of those who take part
    FieldOptimum best_;
    const std::vector<std::unique_ptr<OwnLists>>* relaxed_ = nullptr;
    const std::vector<std::unique_ptr<OwnLists>>* alone_ = nullptr;
    const Division* division_ = nullptr;
    std::vector<TaskSet> parts_;
    std::vector<std::map<TaskSet, Choices>> choices_;
};

}  // namespace

std::vector<int> tasks_to_divide(const FieldProblem& problem, const FieldTeam& team) {
    std::vector<int> tasks;
    for (int task = 0; task < problem.n_task; ++task) {
        bool possible = false;
        for (int uav = 0; uav < problem.n_uav && !possible; ++uav) {
            possible = team.open[task] && team.active[uav] && std::isfinite(team.free_s[uav]) &&
                       problem.capable[problem.at(uav, task)];
        }
        if (possible) tasks.push_back(task);
    }
    return tasks;
}

FieldOptimum field_optimum(const FieldProblem& problem, const FieldTeam& team,
                           const std::vector<FieldList>& known, int threads, Watch& watch) {
    return Proof(problem, team, threads, watch).run(known);
}

}  // namespace peckorder
