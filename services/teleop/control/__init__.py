"""Keys -> held keys -> commands. Pure."""
