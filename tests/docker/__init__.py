"""The real image in real containers, and a person at a real terminal."""
