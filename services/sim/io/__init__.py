"""The keys of robots and of the world: topics out, services in."""
