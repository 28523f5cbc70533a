"""odom -> get_pose, next_goal."""
