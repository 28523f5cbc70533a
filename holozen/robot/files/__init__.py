"""Files of robots and worlds, read into the plain model."""
