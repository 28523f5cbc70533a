"""Terminal, gamepad -> events."""
