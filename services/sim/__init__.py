"""cmd_vel -> odom."""
