"""A gateway to ROS 2 nodes, in the forms of rmw_zenoh and of the bridge to DDS."""
