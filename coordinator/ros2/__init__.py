"""A mission in the ROS 2 graph: topics that mirror it, services that take orders."""
