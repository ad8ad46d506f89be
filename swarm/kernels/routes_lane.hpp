// What a team's search hands a thread: some UAVs' lists to be made better by themselves.
#pragma once

#include <vector>

#include "routes_solution.hpp"
#include "watch.hpp"

namespace peckorder {

class Lane {
 public:
  virtual ~Lane() = default;

  // Work on the lists of these UAVs alone; best := current.
  virtual void load(const std::vector<Route>& routes, const std::vector<int>& uavs) = 0;

  // Fewer if the watch stops it.
  virtual void run(long iterations, double temperature, Watch& watch) = 0;

  virtual const std::vector<int>& uavs() const = 0;
  virtual double best_value() const = 0;  // Σ over those UAVs' lists
  virtual const Route& best_route(int uav) const = 0;
  virtual const Route& current_route(int uav) const = 0;
};

}  // namespace peckorder
