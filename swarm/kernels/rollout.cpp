#include "bindings.hpp"

namespace peckorder {

void bind_rollout(nanobind::module_& module) { (void)module; }

}  // namespace peckorder
