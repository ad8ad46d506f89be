// Own best lists; see field_lookahead.hpp.
#include "field_lookahead.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "watch.hpp"

namespace peckorder {

namespace {

constexpr std::int64_t kMostSteps = 400'000;  // items gone through to improve one list

struct Worth {
    bool feasible = false;
    int n_required = 0;
    double value = 0.0;

    bool better_than(const Worth& other) const {
        if (feasible != other.feasible) return feasible;
        if (n_required != other.n_required) return n_required > other.n_required;
        return value > other.value;
    }
};

// A list that can be done is changed step by step, each of them to a better one.
class Improvement {
  public:
    Improvement(const FieldProblem& problem, int uav, const Progress& begin, int landed_at,
                const std::vector<int>& able, bool may_swap, const FieldList& list)
        : problem_(problem), uav_(uav), landed_at_(landed_at),
          n_base_(may_swap ? problem.n_base : 0) {
        for (const int task : able) {
            const auto holds = [&](Item item) { return !is_base(item) && task_of(item) == task; };
            if (std::none_of(list.begin(), list.end(), holds)) left_.push_back(task);
        }
        reached_.push_back({begin, 0});
        tried_ = list;
        worth_ = worth(0);
        keep(0);
    }

    OwnPlan run() {
        while (steps_ < kMostSteps && (insert_any() || move_any())) {
        }
        return {list_, worth_.value, false};
    }

  private:
    struct Reached {
        Progress progress;
        int n_required;
    };

    // Of `tried_`, whose first `n_same` items are those of `list_`. They count as steps, too: what
    // is found is not to depend on what is remembered.
    Worth worth(std::size_t n_same) {
        Reached now = reached_[n_same];
        Times times;
        Worth worth;
        steps_ += static_cast<std::int64_t>(n_same);
        for (std::size_t i = n_same; i < tried_.size(); ++i) {
            const Item item = tried_[i];
            const bool again = i > 0 ? tried_[i - 1] == item : item == item_of_base(landed_at_);
            if (is_base(item) && (again || i + 1 == tried_.size())) return worth;
            ++steps_;
            if (do_item(problem_, uav_, item, now.progress, times) != Refusal::kNone) return worth;
            if (!is_base(item)) now.n_required += problem_.required[task_of(item)];
        }
        worth.feasible = true;
        worth.n_required = now.n_required;
        worth.value = now.progress.value;
        return worth;
    }

    bool take(std::size_t n_same) {
        const Worth found = worth(n_same);
        if (!found.better_than(worth_)) return false;
        worth_ = found;
        keep(n_same);
        return true;
    }

    // `tried_` is the list from now on.
    void keep(std::size_t n_same) {
        list_ = tried_;
        reached_.resize(n_same + 1);
        for (std::size_t i = n_same; i < list_.size(); ++i) {
            Reached next = reached_.back();
            Times times;
            do_item(problem_, uav_, list_[i], next.progress, times);
            if (!is_base(list_[i])) next.n_required += problem_.required[task_of(list_[i])];
            reached_.push_back(next);
        }
    }

    // A task that is left out, anywhere, as it is or behind a swap.
    bool insert_any() {
        for (std::size_t nth = 0; nth < left_.size(); ++nth) {
            const int task = left_[nth];
            for (std::size_t at = 0; at <= list_.size(); ++at) {
                for (int backwards = 0; backwards <= problem_.is_line[task]; ++backwards) {
                    for (int base = -1; base < n_base_ && steps_ < kMostSteps; ++base) {
                        tried_ = list_;
                        const auto place = static_cast<std::ptrdiff_t>(at);
                        tried_.insert(tried_.begin() + place, item_of_task(task, backwards));
                        if (base >= 0) {
                            tried_.insert(tried_.begin() + place, item_of_base(base));
                        }
                        if (take(at)) {
                            left_.erase(left_.begin() + static_cast<std::ptrdiff_t>(nth));
                            return true;
                        }
                    }
                }
            }
        }
        return false;
    }

    // An item elsewhere, a line in either direction; or a visit to a base left out.
    bool move_any() {
        FieldList without;
        for (std::size_t from = 0; from < list_.size(); ++from) {
            const Item item = list_[from];
            without = list_;
            without.erase(without.begin() + static_cast<std::ptrdiff_t>(from));
            if (is_base(item)) {
                tried_ = without;
                if (take(from)) return true;
            }
            const bool turns = !is_base(item) && problem_.is_line[task_of(item)];
            for (std::size_t to = 0; to <= without.size() && steps_ < kMostSteps; ++to) {
                for (int turned = 0; turned <= (turns ? 1 : 0); ++turned) {
                    if (to == from && !turned) continue;
                    tried_ = without;
                    tried_.insert(tried_.begin() + static_cast<std::ptrdiff_t>(to),
                                  turned ? item ^ 1 : item);
                    if (take(std::min(from, to))) return true;
                }
            }
        }
        return false;
    }

    const FieldProblem& problem_;
    const int uav_, landed_at_, n_base_;
    FieldList list_, tried_;
    std::vector<Reached> reached_;  // after so many items of the list
    std::vector<int> left_;
    Worth worth_;
    std::int64_t steps_ = 0;
};

// Tasks of `open` that the UAV is capable of.
std::vector<int> able_for(const FieldProblem& problem, int uav, const std::vector<int>& open) {
    std::vector<int> able;
    for (const int task : open) {
        if (problem.capable[problem.at(uav, task)]) able.push_back(task);
    }
    return able;
}

}  // namespace

OwnPlan own_plan(const FieldProblem& problem, int uav, const Progress& begin, int landed_at,
                 const std::vector<int>& open, bool may_swap,
                 const std::function<FieldList()>& begin_with) {
    const std::vector<int> able = able_for(problem, uav, open);
    if (able.size() <= static_cast<std::size_t>(kExactOwnTasks)) {
        const BaseUse use = may_swap ? BaseUse::kFree : BaseUse::kForbidden;
        OwnQuestion question{&problem, uav, begin, landed_at, able,
                             std::vector<BaseUse>(problem.n_base, use)};
        question.begin.value = 0.0;
        std::int64_t most = kMostExactSteps / Watch::kStepsBetween;
        Watch watch([&] { return --most <= 0; });
        const OwnBest best = best_list(question, watch);
        if (best.outcome == Outcome::kProven) return {best.list, best.value, true};
    }
    Progress from = begin;
    from.value = 0.0;
    return Improvement(problem, uav, from, landed_at, able, may_swap, begin_with()).run();
}

}  // namespace peckorder
