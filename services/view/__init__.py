"""odom -> cmd_vel."""
