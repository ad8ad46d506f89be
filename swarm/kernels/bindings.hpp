// Every kernel file adds its functions and classes to the module by one of these.
#pragma once

#include <nanobind/nanobind.h>

namespace peckorder {

void bind_exact(nanobind::module_& module);
void bind_field(nanobind::module_& module);
void bind_field_exact(nanobind::module_& module);
void bind_field_team(nanobind::module_& module);
void bind_field_search(nanobind::module_& module);
void bind_field_alone(nanobind::module_& module);
void bind_field_insertion(nanobind::module_& module);
void bind_ground(nanobind::module_& module);
void bind_long_tours(nanobind::module_& module);
void bind_lower_level(nanobind::module_& module);
void bind_motions(nanobind::module_& module);
void bind_paths(nanobind::module_& module);
void bind_problem(nanobind::module_& module);
void bind_rollout(nanobind::module_& module);
void bind_routes(nanobind::module_& module);
void bind_routes_pricing(nanobind::module_& module);
void bind_tours(nanobind::module_& module);
void bind_traffic(nanobind::module_& module);

}  // namespace peckorder
