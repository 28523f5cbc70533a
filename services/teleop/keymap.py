"""The keys of teleop_twist_keyboard and what each means, as data."""

Direction = tuple[int, int, int, int]
"""Forward, left, up, counter-clockwise: each -1, 0 or 1, times the speed (the last: times the turn)."""

MOVES: dict[str, Direction] = {
    "u": (1, 0, 0, 1), "i": (1, 0, 0, 0), "o": (1, 0, 0, -1),
    "j": (0, 0, 0, 1), "l": (0, 0, 0, -1),
    "m": (-1, 0, 0, -1), ",": (-1, 0, 0, 0), ".": (-1, 0, 0, 1),
    "U": (1, 1, 0, 0), "I": (1, 0, 0, 0), "O": (1, -1, 0, 0),
    "J": (0, 1, 0, 0), "L": (0, -1, 0, 0),
    "M": (-1, 1, 0, 0), "<": (-1, 0, 0, 0), ">": (-1, -1, 0, 0),
    "t": (0, 0, 1, 0), "b": (0, 0, -1, 0),
    "up": (1, 0, 0, 0), "down": (-1, 0, 0, 0), "left": (0, 0, 0, 1), "right": (0, 0, 0, -1),
    "s-left": (0, 1, 0, 0), "s-right": (0, -1, 0, 0),
}  # fmt: skip

SPEEDS: dict[str, tuple[float, float]] = {
    "q": (1.1, 1.1), "z": (0.9, 0.9),
    "w": (1.1, 1.0), "x": (0.9, 1.0),
    "e": (1.0, 1.1), "c": (1.0, 0.9),
}  # fmt: skip
"""What a key multiplies the speed and the turn by."""

RESUME = "r"
QUIT = "c-c"

HELP = """\
 turn and go          strafe (shift)       arrows too; shift-left and
   u  i  o              U  I  O            shift-right strafe
   j  k  l              J  K  L            t up, b down
   m  ,  .              M  <  >            any other key: stop

 q/z both speeds +-10 %   w/x only speed   e/c only turn
 r lets the controller drive again         Ctrl-C quits"""
