// Every kernel file adds its functions and classes to the module by one of these.
#pragma once

#include <nanobind/nanobind.h>

namespace peckorder {

void bind_rollout(nanobind::module_& module);
void bind_routes(nanobind::module_& module);

}  // namespace peckorder
