"""What a teaching assistant would see in a robot file."""
