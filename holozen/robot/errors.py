"""The one error of this folder."""


class RobotError(ValueError):
    """A robot cannot be used as it is written. One line: where, what is wrong, what is allowed, what to do."""


def listed(names: list[str], most: int = 12) -> str:
    """The names as one phrase, cut after `most` of them: an error stays one readable line."""
    shown = ", ".join(sorted(names)[:most])
    return shown + f" and {len(names) - most} more" if len(names) > most else shown or "none"
