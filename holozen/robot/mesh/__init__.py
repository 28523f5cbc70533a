"""Mesh files -> points in metres."""
