"""keys -> cmd_vel."""
