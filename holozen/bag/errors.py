"""What can go wrong with a bag."""


class BagError(Exception):
    """A file that cannot be read, or written on. The text is one line that says why."""
