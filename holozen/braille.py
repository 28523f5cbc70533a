"""A small canvas of dots, drawn as text: two by four dots a character in braille, or plain ASCII."""

# Unicode's numbering of the dots of a braille character: 1 2 3 7 down the left, 4 5 6 8 down the right.
_BITS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
_UPPER, _LOWER = 0x1B, 0xE4  # the two top rows of dots, and the two bottom ones
_BRAILLE = [" ", *map(chr, range(0x2801, 0x2900))]  # fonts draw the empty pattern as rings, or not at all
_ASCII = [" '.:"[bool(dots & _UPPER) + 2 * bool(dots & _LOWER)] for dots in range(256)]


class Canvas:
    """`columns` x `rows` characters; dots are counted from (0, 0) at the top left, y downwards.

    What lies outside is not drawn. Coordinates must be finite.
    """

    def __init__(self, columns: int, rows: int) -> None:
        self.columns, self.rows = columns, rows
        self.width, self.height = 2 * columns, 4 * rows  # dots
        self.cells = bytearray(columns * rows)  # row by row, the dots of each character

    def dot(self, x: int, y: int) -> None:
        """Set one dot."""
        if 0 <= x < self.width and 0 <= y < self.height:
            self.cells[(y >> 2) * self.columns + (x >> 1)] |= _BITS[x & 1][y & 3]

    def line(self, x0: float, y0: float, x1: float, y1: float) -> None:
        """Set the dots from one point to another, both included."""
        inside = _clip(x0, y0, x1, y1, self.width - 1, self.height - 1)
        if inside is None:
            return
        x0, y0, x1, y1 = inside
        steps = max(1, round(max(abs(x1 - x0), abs(y1 - y0))))
        for step in range(steps + 1):
            self.dot(round(x0 + (x1 - x0) * step / steps), round(y0 + (y1 - y0) * step / steps))

    def lines(self, ascii: bool = False) -> list[str]:
        """The picture, a text a row, each `columns` long."""
        drawn = [glyph(dots, ascii) for dots in self.cells]
        return ["".join(drawn[row * self.columns : (row + 1) * self.columns]) for row in range(self.rows)]


def glyph(dots: int, ascii: bool = False) -> str:
    """The character for the dots of one cell. In ASCII it tells only the upper half from the lower."""
    return (_ASCII if ascii else _BRAILLE)[dots]


def _clip(
    x0: float, y0: float, x1: float, y1: float, right: float, bottom: float
) -> tuple[float, float, float, float] | None:
    """The part of a line inside [0, right] x [0, bottom], by Liang and Barsky; None if there is none."""
    dx, dy = x1 - x0, y1 - y0
    enter, leave = 0.0, 1.0
    for slope, room in ((-dx, x0), (dx, right - x0), (-dy, y0), (dy, bottom - y0)):
        if slope == 0:
            if room < 0:
                return None
        elif slope < 0:
            enter = max(enter, room / slope)
        else:
            leave = min(leave, room / slope)
    if enter > leave:
        return None
    return x0 + enter * dx, y0 + enter * dy, x0 + leave * dx, y0 + leave * dy
