#include "bindings.hpp"

namespace peckorder {

void bind_routes(nanobind::module_& module) { (void)module; }

}  // namespace peckorder
