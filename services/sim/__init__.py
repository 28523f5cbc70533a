"""cmd_vel -> odom, exposures."""
