"""The everyday models of Gazebo's database, by name: our own boxes, cylinders and cones, with the
sizes of those.

Worlds name them without bringing them along, since Gazebo downloads them. A cone, a barrel and a
can, which are meshes there, have the size of a real one.
"""

import re
from collections.abc import Sequence
from urllib.parse import unquote

Piece = tuple[str, tuple[float, ...], tuple[float, ...]]
"""A shape's name in SDF, its size in metres as there, and its pose: x y z in metres and perhaps
roll pitch yaw.
"""

SUN = "sun"  # a light, not a model
PLANES = ("ground_plane", "asphalt_plane")

WOOD, GREY, ORANGE, RED, WHITE = (
    "0.6 0.4 0.2 1",
    "0.7 0.7 0.7 1",
    "1 0.45 0.05 1",
    "0.8 0.1 0.1 1",
    "0.9 0.9 0.9 1",
)


def _box(x: float, y: float, z: float, *pose: float) -> Piece:
    return "box", (x, y, z), pose or (0.0, 0.0, z / 2)


def _round(kind: str, radius: float, length: float, *pose: float) -> Piece:
    return kind, (radius, length), pose or (0.0, 0.0, length / 2)


_SHELVES = [
    _box(0.88, 0.4, thick, 0, -0.195, z)
    for thick, z in ((0.06, 0.03), (0.02, 0.43), (0.02, 0.8), (0.02, 1.19))
]

MODELS: dict[str, tuple[float, str, Sequence[Piece]]] = {
    "table": (
        0.0,
        WOOD,
        [
            _box(1.5, 0.8, 0.03, 0, 0, 1),
            *(
                _round("cylinder", 0.02, 1.0, x, y, 0.5)
                for x in (0.68, -0.68)
                for y in (0.38, -0.38)
            ),
        ],
    ),
    "cafe_table": (
        0.0,
        WOOD,
        [
            _box(0.913, 0.913, 0.04, 0, 0, 0.755),
            _box(0.042, 0.042, 0.74),
            _box(0.56, 0.56, 0.04),
        ],
    ),
    "bookshelf": (
        0.0,
        WOOD,
        [
            _box(0.9, 0.01, 1.2, 0, 0.005, 0.6),
            *(_box(0.02, 0.4, 1.2, x, -0.195, 0.6) for x in (0.45, -0.45)),
            *_SHELVES,
        ],
    ),
    "cabinet": (
        0.0,
        GREY,
        [
            _box(0.02, 0.45, 1.02, 0.235, 0, 0.51),
            *(_box(0.45, 0.02, 1.02, 0, y, 0.51) for y in (0.235, -0.235)),
            *(_box(0.45, 0.45, 0.02, 0, 0, z) for z in (0.01, 0.51, 1.01)),
        ],
    ),
    "grey_wall": (0.0, GREY, [_box(7.5, 0.2, 2.8)]),
    "brick_box_3x1x3": (0.0, RED, [_box(3, 1, 3)]),
    "jersey_barrier": (
        0.0,
        WHITE,
        [
            _box(4.06542, 0.3063, 1.143),
            _box(4.06542, 0.8107, 0.064516),
            _box(4.06542, 0.65, 0.1, 0, 0, 0.1),
            _box(4.06542, 0.5, 0.1, 0, 0, 0.2),
            *(
                _box(4.06542, 0.5, 0.064516, 0, -side * 0.224, 0.2401, side * 0.9, 0, 0)
                for side in (1, -1)
            ),
        ],
    ),
    "cinder_block": (
        17.0,
        GREY,
        [
            *(_box(0.43495, 0.0339, 0.2032, 0, y, 0.1016) for y in (0.08465, -0.08465)),
            *(_box(0.0339, 0.1354, 0.203, x, 0, 0.1016) for x in (0.18625, 0, -0.18625)),
        ],
    ),
    "cardboard_box": (20.0, WOOD, [_box(0.5, 0.4, 0.3)]),
    "wood_cube_2_5cm": (0.0093, WOOD, [_box(0.025, 0.025, 0.025, 0, 0, 0)]),
    "wood_cube_5cm": (0.075, WOOD, [_box(0.05, 0.05, 0.05, 0, 0, 0)]),
    "wood_cube_7_5cm": (0.25, WOOD, [_box(0.075, 0.075, 0.075, 0, 0, 0)]),
    "wood_cube_10cm": (0.6, WOOD, [_box(0.1, 0.1, 0.1, 0, 0, 0)]),
    "construction_cone": (
        2.0,
        ORANGE,
        [_round("cone", 0.18, 0.64, 0, 0, 0.34), _box(0.38, 0.38, 0.04)],
    ),
    "construction_barrel": (20.0, ORANGE, [_round("cylinder", 0.295, 1.03)]),
    "coke_can": (0.39, RED, [_round("cylinder", 0.033, 0.123)]),
    "beer": (0.39, RED, [_round("cylinder", 0.055, 0.23)]),
}
"""Name -> mass in kg (0: it is static), its colour and its pieces."""

PLANE = """<model name="ground_plane"><static>true</static><link name="link">
<collision name="collision"><geometry><plane><size>100 100</size></plane></geometry></collision>
<visual name="visual"><geometry><plane><size>100 100</size></plane></geometry>
<material><diffuse>0.7 0.7 0.7 1</diffuse></material></visual></link></model>"""


def name_in(uri: str) -> str:
    """The name in the database of the model that a URI means: `model://Ground Plane` and
    `https://fuel.gazebosim.org/1.0/OpenRobotics/models/Ground%20Plane/2` are ground_plane.
    """
    scheme, _, rest = unquote(uri.strip()).rpartition("://")
    path = rest.partition("/models/")[2] if scheme in ("http", "https") else rest
    return re.sub(r"\s+", "_", path.strip("/").partition("/")[0].strip().lower())


def sdf_of(name: str) -> str:
    """The SDF of a model; empty if there is none of that name."""
    if name in PLANES:
        return f"<sdf>{PLANE}</sdf>"
    if name not in MODELS:
        return ""
    mass, color, pieces = MODELS[name]
    shapes = "".join(_shapes(number, piece, color) for number, piece in enumerate(pieces))
    body = _inertial(mass, pieces) if mass else ""
    static = "false" if mass else "true"
    return (
        f'<sdf><model name="{name}"><static>{static}</static><link '
        f'name="link">{body}{shapes}</link></model></sdf>'
    )


def _shapes(number: int, piece: Piece, color: str) -> str:
    kind, size, pose = piece
    names = {"box": ("size",)}.get(kind, ("radius", "length"))
    values = [" ".join(map(str, size))] if kind == "box" else [*map(str, size)]
    inside = "".join(f"<{name}>{value}</{name}>" for name, value in zip(names, values, strict=True))
    place = " ".join(map(str, (*pose, 0, 0, 0)[:6]))
    both = f"<pose>{place}</pose><geometry><{kind}>{inside}</{kind}></geometry>"
    material = f"<material><diffuse>{color}</diffuse></material>"
    return (
        f'<collision name="c{number}">{both}</collision><visual '
        f'name="v{number}">{both}{material}</visual>'
    )


def _inertial(mass: float, pieces: Sequence[Piece]) -> str:
    """That of a box around the pieces."""
    corners = [_half(piece) for piece in pieces]
    low, high = (
        [
            end(
                piece[2][axis] + sign * half[axis]
                for piece, half in zip(pieces, corners, strict=True)
            )
            for axis in range(3)
        ]
        for end, sign in ((min, -1), (max, 1))
    )
    x, y, z = (b - a for a, b in zip(low, high, strict=True))
    middle = " ".join(str((a + b) / 2) for a, b in zip(low, high, strict=True))
    moments = (mass * (b * b + c * c) / 12 for b, c in ((y, z), (x, z), (x, y)))
    tensor = "".join(
        f"<{name}>{value}</{name}>"
        for name, value in zip(("ixx", "iyy", "izz"), moments, strict=True)
    )
    return (
        f"<inertial><pose>{middle} 0 0 "
        f"0</pose><mass>{mass}</mass><inertia>{tensor}</inertia></inertial>"
    )


def _half(piece: Piece) -> tuple[float, float, float]:
    kind, size, _ = piece
    return (
        (size[0] / 2, size[1] / 2, size[2] / 2)
        if kind == "box"
        else (size[0], size[0], size[1] / 2)
    )
