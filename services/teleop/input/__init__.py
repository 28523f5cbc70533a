"""Terminal and gamepad -> events."""
