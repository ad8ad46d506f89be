// What a lane of the search takes out of its lists, or exchanges between them (field_search.hpp).
#include <algorithm>

#include "field_search.hpp"

namespace peckorder {

namespace {
constexpr double kMeanTorn = 8.0, kLongestString = 8.0;
constexpr double kSplitShare = 0.5, kSplitDepth = 0.3;
constexpr double kOutShare = 0.05;  // of iterations while tasks are out, that make room for one
}  // namespace

void FieldLane::ruin() {
    const double kind = random_.uniform();
    if (!out_.empty() && random_.uniform() < kOutShare) {
        tear_about(out_[random_.below(static_cast<int>(out_.size()))]);
    } else if (any_swaps_ && kind < 0.08) {
        swap_anew();
    } else if (kind < 0.16) {
        exchange_tails();
    } else if (kind < 0.26) {
        tear_random();
    } else if (kind < 0.32) {
        tear_list();
    } else {
        tear_strings();
    }
}

void FieldLane::tear_strings() {
    int seed = tasks_[random_.below(static_cast<int>(tasks_.size()))];
    if (!out_.empty() && random_.uniform() < 0.2)
        seed = out_[random_.below(static_cast<int>(out_.size()))];
    std::size_t busy = 0;
    for (const int uav : uavs_) busy += !lists_[uav].order.empty();
    const double mean = static_cast<double>(tasks_.size() - out_.size()) /
                        static_cast<double>(std::max<std::size_t>(1, busy));
    const double longest = std::min(kLongestString, std::max(1.0, mean));
    const double most = std::max(1.0, 4.0 * kMeanTorn / (1.0 + longest) - 1.0);
    const int strings = 1 + static_cast<int>(random_.uniform() * most);
    if (list_of_[seed] >= 0) tear(seed, longest);
    for (const int task : near_[seed]) {
        if (static_cast<int>(touched_.size()) >= strings) break;
        if (list_of_[task] >= 0 && !is_touched_[list_of_[task]]) tear(task, longest);
    }
}

// Take a string that holds `task` out of its list; sometimes keep some tasks inside the string.
void FieldLane::tear(int task, double longest) {
    const int uav = list_of_[task];
    const std::vector<Item>& order = lists_[uav].order;
    const int size = static_cast<int>(order.size());
    const int length = 1 + static_cast<int>(random_.uniform() * std::min<double>(longest, size));
    int kept = 0;
    if (length > 1 && length < size && random_.uniform() < kSplitShare) {
        kept = 1;
        while (length + kept < size && random_.uniform() > kSplitDepth) ++kept;
    }
    const int span = std::min(size, length + kept);
    int here = 0;
    while (task_of(order[here]) != task) ++here;
    const int low = std::max(0, here - span + 1), high = std::min(here, size - span);
    const int begin = low + random_.below(high - low + 1);
    const int gap = kept == 0 ? span : 1 + random_.below(span - kept);
    touch(uav);
    // The later part first, so that places of the earlier one stay; its list is solved anew twice.
    if (span > gap + kept) remove(uav, begin + gap + kept, span - gap - kept);
    const std::size_t left = lists_[uav].order.size();
    if (static_cast<std::size_t>(begin) < left)
        remove(uav, begin, std::min<std::size_t>(gap, left - begin));
}

void FieldLane::tear_random() {
    const int most = std::min<int>(static_cast<int>(kMeanTorn), static_cast<int>(tasks_.size()));
    const int count = 1 + random_.below(most);
    for (int k = 0; k < count; ++k) {
        const int task = tasks_[random_.below(static_cast<int>(tasks_.size()))];
        const int uav = list_of_[task];
        if (uav < 0) continue;
        touch(uav);
        const std::vector<Item>& order = lists_[uav].order;
        std::size_t here = 0;
        while (task_of(order[here]) != task) ++here;
        remove(uav, here, 1);
    }
}

// Of some lists what is done when `task` could be.
void FieldLane::tear_about(int task) {
    const int lists = 1 + random_.below(3);
    const double last_s = std::min(std::min(problem_.closes_s[task], problem_.due_s[task]),
                                   problem_.horizon_s);
    const double first_s = problem_.opens_s[task];
    const double time_s = first_s + random_.uniform() * std::max(0.0, last_s - first_s);
    const std::vector<int>& able = able_[task];
    for (int k = 0; k < lists; ++k) {
        const int uav = able[random_.below(static_cast<int>(able.size()))];
        const FieldList& list = lists_[uav];
        if (list.order.empty() || is_touched_[uav]) continue;
        const std::size_t count = 1 + static_cast<std::size_t>(random_.below(3));
        std::size_t here = 0;
        while (here + 1 < list.order.size() && here + 2 < list.offsets.size() &&
               list.offsets[here + 1] < list.offsets[here + 2] &&
               list.labels[list.offsets[here + 1]].progress.time_s < time_s) {
            ++here;
        }
        here -= std::min<std::size_t>(here, random_.below(2));
        touch(uav);
        remove(uav, here, std::min(count, list.order.size() - here));
    }
}

// One list, or its end, and sometimes that of another UAV.
void FieldLane::tear_list() {
    const int lists = 1 + random_.below(2);
    for (int k = 0; k < lists; ++k) {
        const int uav = uavs_[random_.below(static_cast<int>(uavs_.size()))];
        const std::size_t size = lists_[uav].order.size();
        if (size == 0 || is_touched_[uav]) continue;
        const std::size_t most =
            std::min<std::size_t>(size, 2 * static_cast<std::size_t>(kMeanTorn));
        const std::size_t count =
            random_.uniform() < 0.5 ? most : 1 + random_.below(static_cast<int>(most));
        touch(uav);
        remove(uav, size - count, count);
    }
}

// Two lists go on with each other's ends from near tasks on.
void FieldLane::exchange_tails() {
    const int task = tasks_[random_.below(static_cast<int>(tasks_.size()))];
    const int one = list_of_[task];
    if (one < 0 || near_[task].empty()) return;
    const int few = std::min<int>(12, static_cast<int>(near_[task].size()));
    const int other_task = near_[task][random_.below(few)];
    const int other = list_of_[other_task];
    if (other < 0 || other == one) return;
    const auto place = [&](int uav, int wanted) {
        std::size_t here = 0;
        while (task_of(lists_[uav].order[here]) != wanted) ++here;
        return here;
    };
    const std::size_t at = place(one, task) + static_cast<std::size_t>(random_.below(2));
    const std::size_t at_other =
        place(other, other_task) + static_cast<std::size_t>(random_.below(2));
    touch(one);
    touch(other);
    std::vector<Item>& a = lists_[one].order;
    std::vector<Item>& b = lists_[other].order;
    std::vector<Item> tail(a.begin() + static_cast<std::ptrdiff_t>(at), a.end());
    a.resize(at);
    a.insert(a.end(), b.begin() + static_cast<std::ptrdiff_t>(at_other), b.end());
    b.resize(at_other);
    b.insert(b.end(), tail.begin(), tail.end());
    for (std::size_t k = at; k < a.size(); ++k) move(task_of(a[k]), one);
    for (std::size_t k = at_other; k < b.size(); ++k) move(task_of(b[k]), other);
    settle(one, at);
    settle(other, at_other);
}

// Some lists choose their base visits anew one after the other, now and then overlooking some.
void FieldLane::swap_anew() {
    const int lists = 1 + random_.below(std::min<int>(3, static_cast<int>(uavs_.size())));
    for (int k = 0; k < lists; ++k) {
        const int uav = uavs_[random_.below(static_cast<int>(uavs_.size()))];
        if (lists_[uav].order.empty() || is_touched_[uav]) continue;
        touch(uav);
        stays_.set(uav, {});
    }
    const double overlooks = random_.uniform() < 0.5 ? 0.25 : 0.0;
    for (std::size_t k = 0; k < touched_.size(); ++k) settle(touched_[k], 0, overlooks);
}

}  // namespace peckorder
