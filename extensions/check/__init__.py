"""Mistakes in robot files, as a teaching assistant would find them."""
