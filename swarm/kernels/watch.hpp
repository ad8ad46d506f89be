// Whether a kernel is to end before it is done, asked of its caller every few milliseconds.
//
// Kernels read no clock: they count their steps, and a Watch asks after so many of them. What a
// kernel gives back once it was told to stop is said by the kernel.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <limits>
#include <utility>

namespace peckorder {

class Watch {
 public:
  Watch() = default;  // never stops
  explicit Watch(std::function<bool()> should_stop) : should_stop_(std::move(should_stop)) {}
  explicit Watch(std::int64_t most_steps) : most_steps_(most_steps) {}  // asks nobody

  // `steps` more, of some ten nanoseconds each, are done; whether to stop. From any thread.
  bool stops_after(std::int64_t steps) {
    if (!should_stop_ && most_steps_ == kNoEnd) return false;
    const std::int64_t before = steps_.fetch_add(steps, std::memory_order_relaxed);
    if (before + steps >= most_steps_) stopped_.store(true, std::memory_order_relaxed);
    if (!should_stop_) return stopped();
    if (before / kStepsBetween != (before + steps) / kStepsBetween && !stopped() && should_stop_())
      stopped_.store(true, std::memory_order_relaxed);
    return stopped();
  }

  bool stopped() const { return stopped_.load(std::memory_order_relaxed); }

  static constexpr std::int64_t kStepsBetween = 200'000;

 private:
  static constexpr std::int64_t kNoEnd = std::numeric_limits<std::int64_t>::max();

  std::function<bool()> should_stop_;
  std::int64_t most_steps_ = kNoEnd;
  std::atomic<std::int64_t> steps_{0};
  std::atomic<bool> stopped_{false};
};

}  // namespace peckorder
