// How kernels ask a Python callable whether to stop.
#pragma once

#include <nanobind/nanobind.h>

#include <exception>
#include <optional>

#include "watch.hpp"

namespace peckorder {

// Asks `should_stop`, which takes nothing and may be None: never. What it raises stops the kernel
// and is raised again by `released`. The GIL must be free while the watch is in use.
class PythonWatch {
 public:
  explicit PythonWatch(nanobind::handle should_stop) {
    if (should_stop.is_none()) return;
    watch_.emplace([this, should_stop] { return asked(should_stop); });
  }

  // work(watch) without the GIL.
  template <typename Work>
  void released(const Work& work) {
    {
      const nanobind::gil_scoped_release free;
      work(watch_ ? *watch_ : never_);
    }
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  bool asked(nanobind::handle should_stop) {
    const nanobind::gil_scoped_acquire held;
    try {
      return nanobind::cast<bool>(should_stop());
    } catch (...) {
      if (!failure_) failure_ = std::current_exception();
      return true;
    }
  }

  std::optional<Watch> watch_;
  Watch never_;
  std::exception_ptr failure_;  // guarded by the GIL
};

}  // namespace peckorder
