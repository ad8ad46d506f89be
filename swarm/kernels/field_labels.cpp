// Label setting for one UAV; see field_labels.hpp.
//
// When may label A make label B superfluous, both having done the same tasks and standing at the
// same node? If A can follow whatever list B goes on with, and earns no less. A that comes no later
// to every item earns no less, and meets every window and due time. What is left is energy:
// - In the air A must keep up with B's sortie: it ends no earlier, and waiting counts alike.
// - Behind a swap the sortie begins with the departure, which for A is earlier: if A then waits in
//   the air where B needn't, its battery may not last. That is impossible where no task opens later
//   than one can be there as the second of such a sortie (`calm`), or at equal times.
// - Behind a relaxed base waiting costs nothing: there the budget of pure flight is compared.
#include "field_labels.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace peckorder {

namespace {

using Size = std::size_t;

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
constexpr double kEndless = std::numeric_limits<double>::infinity();
constexpr double kRelaxedToleranceS = 2e-6;  // sums in another order must not refuse more

struct Label {
    double time_s, sortie_end_s, value;
    std::uint32_t parent, next;  // in `labels`; next of the same set and node
    Item item;
    std::int16_t row;  // visits in a row
    bool delayed, dead;
};

double budget_s(const Label& label) { return label.sortie_end_s - label.time_s; }

// The labels of one UAV while they are set.
class Labels {
  public:
    Labels(const OwnQuestion& question, Watch& watch)
        : question_(question), problem_(*question.problem), watch_(watch),
          n_(static_cast<int>(question.tasks.size())), n_set_(Size{1} << n_),
          n_node_(2 * n_ + problem_.n_base) {
        heads_.assign(n_set_ * static_cast<Size>(n_node_), kNone);
        reached_.assign(n_set_, 0);
        reached_[0] = 1;
        prepare_sets();
    }

    Outcome run(std::vector<double>& value, std::vector<Size>& offset, FieldList& flat) {
        value.assign(n_set_, kImpossible);
        offset.assign(n_set_ + 1, 0);
        value[0] = 0.0;
        for (Size set = 0; set < n_set_; ++set) {
            if (reached_[set]) {
                const std::uint32_t best = settle(static_cast<TaskSet>(set));
                if (best != kNone) {
                    value[set] = labels_[best].value;
                    append_list(best, flat);
                }
            }
            offset[set + 1] = flat.size();
            if (labels_.size() > kMostLabels) return Outcome::kTooLarge;
            if (watch_.stopped()) return Outcome::kStopped;
        }
        return Outcome::kProven;
    }

    Size n_label() const { return labels_.size(); }

  private:
    std::uint32_t& head(TaskSet set, int node) {
        return heads_[static_cast<Size>(set) * static_cast<Size>(n_node_) +
                      static_cast<Size>(node)];
    }

    void prepare_sets() {
        double land_s[32], air_s[32];
        can_swap_ = question_.swaps();
        for (int i = 0; i < n_; ++i) {
            const double after_s = second_after_s(i);
            const double opens_s = problem_.opens_s[question_.tasks[i]];
            land_s[i] = opens_s - after_s;
            air_s[i] = opens_s - (after_s + least_swap_s_);
        }
        survived_.resize(n_set_);
        all_open_s_.assign(n_set_, kImpossible);
        calm_landed_s_.assign(n_set_, kImpossible);
        calm_air_s_.assign(n_set_, kImpossible);
        survived_[0] = question_.begin.survived;
        for (Size set = 0; set < n_set_; ++set) {
            int n_left = 0;
            for (int i = 0; i < n_; ++i) {
                const int task = question_.tasks[i];
                if (set >> i & 1) {
                    const Size before = set & ~(Size{1} << i);
                    survived_[set] =
                        survived_[before] * problem_.survival[problem_.at(question_.uav, task)];
                    continue;
                }
                ++n_left;
                all_open_s_[set] = std::max(all_open_s_[set], problem_.opens_s[task]);
                calm_landed_s_[set] = std::max(calm_landed_s_[set], land_s[i]);
                calm_air_s_[set] = std::max(calm_air_s_[set], air_s[i]);
            }
            if (n_left <= 1 || !free_base_) {
                calm_landed_s_[set] = calm_air_s_[set] = kImpossible;
            }
        }
    }

    // At least so long after a UAV is ready at a free base it comes to task i as its second.
    double second_after_s(int i) {
        double after_s = kEndless;
        for (int base = 0; base < problem_.n_base; ++base) {
            if (!can_swap_ || question_.base_use[base] != BaseUse::kFree) continue;
            free_base_ = true;
            least_swap_s_ = std::min(least_swap_s_, problem_.swap_s[base]);
            const double* legs_s = problem_.legs_from(question_.uav, problem_.base_node(base));
            for (int j = 0; j < n_; ++j) {
                for (int way = 0; way < 4 && j != i; ++way) {
                    const Item first = item_of_task(question_.tasks[j], way & 1);
                    const Item second = item_of_task(question_.tasks[i], way >> 1);
                    const double* on_s =
                        problem_.legs_from(question_.uav, problem_.leave_node(first));
                    after_s = std::min(
                        after_s, legs_s[problem_.enter_node(first)] +
                                     problem_.line_time_s(question_.uav, first) +
                                     problem_.service_s[question_.tasks[j]] +
                                     on_s[problem_.enter_node(second)]);
                }
            }
        }
        return after_s;
    }

    // Extends all labels of a set; the best of those that end with a task.
    std::uint32_t settle(TaskSet set) {
        queue_.clear();
        settling_ = set;
        std::uint32_t best = kNone;
        if (set == 0) extend(kNone, set);
        for (int i = 0; i < n_; ++i) {
            if (!(set >> i & 1)) continue;
            for (int back = 0; back < 2; ++back) {
                for (std::uint32_t at = head(set, 2 * i + back); at != kNone;
                     at = labels_[at].next) {
                    if (best == kNone || labels_[at].value > labels_[best].value) best = at;
                    extend(at, set);
                }
            }
        }
        for (Size next = 0; next < queue_.size(); ++next) {
            if (!labels_[queue_[next]].dead) extend(queue_[next], set);
            if (labels_.size() > kMostLabels || watch_.stopped()) break;
        }
        return best;
    }

    Progress progress_of(std::uint32_t at, TaskSet set) const {
        if (at == kNone) return question_.begin;
        const Label& label = labels_[at];
        Progress progress;
        progress.time_s = label.time_s;
        progress.sortie_end_s = label.sortie_end_s;
        progress.landed = is_base(label.item);
        progress.legs_s = problem_.legs_from(
            question_.uav, progress.landed ? problem_.base_node(base_of(label.item))
                                           : problem_.leave_node(label.item));
        progress.survived = survived_[set];
        progress.value = label.value;
        return progress;
    }

    void extend(std::uint32_t at, TaskSet set) {
        const Progress from = progress_of(at, set);
        const bool delayed = at != kNone && labels_[at].delayed;
        const int row = at == kNone ? 0 : labels_[at].row;
        const int here = at == kNone ? question_.landed_at
                                     : (from.landed ? base_of(labels_[at].item) : -1);
        int tried = 0;
        for (int i = 0; i < n_; ++i) {
            if (set >> i & 1) continue;
            for (int back = 0; back <= problem_.is_line[question_.tasks[i]]; ++back, ++tried) {
                const Item item = item_of_task(question_.tasks[i], back);
                Progress progress = from;
                bool behind = delayed;
                if (!extend_relaxed(question_, item, behind, progress)) continue;
                insert(set | TaskSet{1} << i, 2 * i + back, label(progress, at, item, 0, behind));
            }
        }
        if (can_swap_ && set + 1 != n_set_ && row < question_.most_in_a_row()) {
            for (int base = 0; base < problem_.n_base; ++base, ++tried) {
                if (base == here) continue;
                Progress progress = from;
                bool behind = delayed;
                const Item item = item_of_base(base);
                if (!extend_relaxed(question_, item, behind, progress)) continue;
                const std::uint32_t made =
                    insert(set, 2 * n_ + base, label(progress, at, item, row + 1, behind));
                if (made != kNone) queue_.push_back(made);
            }
        }
        watch_.stops_after(tried);
    }

    static Label label(const Progress& progress, std::uint32_t parent, Item item, int row,
                       bool delayed) {
        return {progress.time_s, progress.sortie_end_s, progress.value, parent, kNone, item,
                static_cast<std::int16_t>(row), delayed, false};
    }

    std::uint32_t insert(TaskSet set, int node, const Label& made) {
        std::uint32_t* link = &head(set, node);
        int looked = 0;
        while (*link != kNone) {
            Label& other = labels_[*link];
            if (dominates(other, made, set)) return kNone;
            if (dominates(made, other, set)) {
                other.dead = true;
                if (set != settling_) unused_.push_back(*link);  // nothing comes from it yet
                *link = other.next;
            } else {
                link = &other.next;
            }
            ++looked;
        }
        watch_.stops_after(looked);
        reached_[set] = 1;
        if (!unused_.empty()) {
            const std::uint32_t at = unused_.back();
            unused_.pop_back();
            *link = at;
            labels_[at] = made;
            return at;
        }
        const auto at = static_cast<std::uint32_t>(labels_.size());
        *link = at;  // before the vector moves what it points into
        labels_.push_back(made);
        return at;
    }

    bool dominates(const Label& a, const Label& b, TaskSet set) const {
        if (a.time_s > b.time_s || a.value < b.value || a.row > b.row) return false;
        if (is_base(a.item)) {
            if (a.delayed || a.time_s >= calm_landed_s_[set]) return true;
            return !b.delayed && a.time_s == b.time_s;
        }
        if (a.delayed) return budget_s(a) >= budget_s(b);
        if (b.delayed) return a.time_s >= all_open_s_[set] && budget_s(a) >= budget_s(b);
        if (a.sortie_end_s < b.sortie_end_s) return false;
        return a.time_s == b.time_s || a.time_s >= calm_air_s_[set];
    }

    void append_list(std::uint32_t at, FieldList& flat) const {
        const Size first = flat.size();
        for (; at != kNone; at = labels_[at].parent) flat.push_back(labels_[at].item);
        std::reverse(flat.begin() + static_cast<std::ptrdiff_t>(first), flat.end());
    }

    const OwnQuestion& question_;
    const FieldProblem& problem_;
    Watch& watch_;
    const int n_;
    const Size n_set_;
    const int n_node_;
    bool can_swap_ = false, free_base_ = false;
    double least_swap_s_ = kEndless;
    std::vector<double> survived_;       // of each set
    std::vector<double> all_open_s_;     // of each set: from then on nobody waits for the others
    std::vector<double> calm_landed_s_;  // from then on being early never harms; landed
    std::vector<double> calm_air_s_;     // the same in the air
    std::vector<std::uint8_t> reached_;
    std::vector<std::uint32_t> heads_;
    std::vector<std::uint32_t> queue_;   // landed labels of the set that is being settled
    std::vector<std::uint32_t> unused_;  // places in `labels_`
    TaskSet settling_ = 0;
    std::vector<Label> labels_;
};

}  // namespace

bool OwnQuestion::swaps() const {
    if (!std::isfinite(problem->full_s[uav])) return false;
    return std::any_of(base_use.begin(), base_use.end(),
                       [](BaseUse use) { return use != BaseUse::kForbidden; });
}

bool extend_relaxed(const OwnQuestion& question, Item item, bool& delayed, Progress& progress) {
    const FieldProblem& problem = *question.problem;
    Times times;
    if (is_base(item)) {
        const BaseUse use = question.base_use[base_of(item)];
        if (use == BaseUse::kForbidden) return false;
        delayed = delayed || use == BaseUse::kRelaxed;
        return do_item(problem, question.uav, item, progress, times) == Refusal::kNone;
    }
    if (!delayed || progress.landed) {
        return do_task(problem, question.uav, item, progress, times) == Refusal::kNone;
    }
    const double sortie_end_s = progress.sortie_end_s;
    progress.sortie_end_s = kEndless;
    if (do_task(problem, question.uav, item, progress, times) != Refusal::kNone) return false;
    progress.sortie_end_s = sortie_end_s + (times.begin_s - times.arrive_s);
    const double home_s = problem.home_time_s(question.uav, problem.leave_node(item));
    return times.end_s + home_s <= progress.sortie_end_s + kRelaxedToleranceS;
}

OwnLists::OwnLists(const OwnQuestion& question, Watch& watch) {
    Labels labels(question, watch);
    outcome_ = labels.run(value_, offset_, flat_);
    n_label_ = labels.n_label();
}

FieldList OwnLists::list(TaskSet set) const {
    const auto at = [&](Size place) { return flat_.begin() + static_cast<std::ptrdiff_t>(place); };
    return {at(offset_[set]), at(offset_[set + 1])};
}

OwnBest best_list(const OwnQuestion& question, Watch& watch) {
    const OwnLists lists(question, watch);
    OwnBest best;
    best.outcome = lists.outcome();
    if (best.outcome != Outcome::kProven) return best;
    TaskSet required = 0, chosen = 0;
    for (Size i = 0; i < question.tasks.size(); ++i) {
        if (question.problem->required[question.tasks[i]]) required |= TaskSet{1} << i;
    }
    const auto left_out = [&](TaskSet set) {
        int count = 0;
        for (TaskSet left = required & ~set; left; left &= left - 1) ++count;
        return count;
    };
    best.n_left_out = left_out(0);
    for (TaskSet set = 1; set < TaskSet{1} << question.tasks.size(); ++set) {
        if (lists.value(set) == kImpossible) continue;
        const int count = left_out(set);
        if (count > best.n_left_out) continue;
        if (count == best.n_left_out && lists.value(set) <= best.value) continue;
        best.n_left_out = count;
        best.value = lists.value(set);
        chosen = set;
    }
    best.list = lists.list(chosen);
    return best;
}

}  // namespace peckorder
