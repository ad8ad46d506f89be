// The extension module `swarm.kernels._kernels`: one list of all kernels.
#include "bindings.hpp"

NB_MODULE(_kernels, module) {
    module.doc() = "Compiled kernels; call them through the typed functions of swarm.kernels.";
    peckorder::bind_problem(module);
    peckorder::bind_tours(module);
    peckorder::bind_traffic(module);
    peckorder::bind_long_tours(module);
    peckorder::bind_lower_level(module);
    peckorder::bind_exact(module);
    peckorder::bind_rollout(module);
    peckorder::bind_routes(module);
    peckorder::bind_routes_pricing(module);
    peckorder::bind_field(module);
    peckorder::bind_field_exact(module);
    peckorder::bind_field_team(module);
    peckorder::bind_field_search(module);
    peckorder::bind_field_alone(module);
    peckorder::bind_field_insertion(module);
    peckorder::bind_ground(module);
    peckorder::bind_motions(module);
    peckorder::bind_paths(module);
}
