"""Makes base.dae, wheel.stl and logo.png of hb_bot: `python meshes/make_meshes.py [OUTDIR]`.

All figures here are metres, x forward, y left, z up; the files hold them divided by the scale in
the URDF.
"""

import argparse
import struct
import zlib
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Colour = tuple[float, float, float]  # red green blue, 0 to 1
BASE_SCALE, WHEEL_SCALE = 0.01, 5.0  # as in urdf/hb_bot.urdf.xacro
BASE_ORIGIN = 0.28  # height of base.dae's origin above footprint_link, as in the URDF
WHEELS = np.array([(0.0, 0.68), (-0.58, -0.36), (0.58, -0.36)])  # wheel centres, x y
WHEEL_RADIUS, WHEEL_WIDTH, AXLE_HEIGHT = 0.14, 0.13, 0.18
ROLLERS, ROLLER_RADIUS, ROLLER_LENGTH = 8, 0.03, 0.064  # rollers in each of two rows
ORANGE, WHITE, INK = (0.95, 0.45, 0.10), (0.96, 0.96, 0.94), (0.13, 0.16, 0.20)
STEEL, SILVER, BLUE = (0.45, 0.48, 0.52), (0.78, 0.80, 0.82), (0.10, 0.45, 0.75)


class Mesh(NamedTuple):
    points: Array  # (n, 3)
    faces: NDArray[np.int64]  # (m, 3), counterclockwise seen from outside


def circle(n: int, start: float = 0.0) -> Array:
    """n unit vectors, (n, 2), counterclockwise; the first is `start` steps after x."""
    angle = 2 * np.pi * (np.arange(n) + start) / n
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def skin(rings: Array) -> Mesh:
    """The closed surface over rings of points, (k, n, 3), lowest first, each counterclockwise from
    above.
    """
    k, n, _ = rings.shape
    here = np.arange(k * n).reshape(k, n)
    beside, low, high = np.roll(here, -1, axis=1), np.full(n, k * n), np.full(n, k * n + 1)
    sides = [(here[:-1], beside[:-1], beside[1:]), (here[:-1], beside[1:], here[1:])]
    lids = [(beside[0], here[0], low), (here[-1], beside[-1], high)]
    faces = np.concatenate([np.stack(corners, axis=-1).reshape(-1, 3) for corners in sides + lids])
    return Mesh(np.vstack([rings.reshape(-1, 3), rings[0].mean(0), rings[-1].mean(0)]), faces)


def lathe(profile: list[tuple[float, float]], n: int) -> Mesh:
    """(radius, z) points, the lowest first, turned about z."""
    return skin(np.stack([np.insert(circle(n) * radius, 2, z, axis=1) for radius, z in profile]))


def extrude(outline: Array, low: float, high: float) -> Mesh:
    """A convex counterclockwise outline, (n, 2), as a plate between two heights."""
    return skin(np.stack([np.insert(outline, 2, z, axis=1) for z in (low, high)]))


def box(x: tuple[float, float], width: float, z: tuple[float, float]) -> Mesh:
    return extrude(
        np.array([(x[0], -width), (x[1], -width), (x[1], width), (x[0], width)]) * (1, 0.5), *z
    )


def rounded(corners: Array, radius: float, n: int) -> Array:
    """A convex polygon, (k, 2), thickened by a radius: the farthest corner each way, plus the
    radius.
    """
    ways = circle(n, 0.5)  # half a step: in line with an edge two corners would be equally far
    return np.asarray(corners[(ways @ corners.T).argmax(axis=1)] + radius * ways)


def turn(mesh: Mesh, axis: str, angle: float) -> Mesh:
    """The mesh turned about an axis through the origin, right-handed."""
    j, k, c, s = "zxy".index(axis), "yzx".index(axis), np.cos(angle), np.sin(angle)
    points = mesh.points.copy()
    points[:, j] = c * mesh.points[:, j] - s * mesh.points[:, k]
    points[:, k] = s * mesh.points[:, j] + c * mesh.points[:, k]
    return Mesh(points, mesh.faces)


def shift(mesh: Mesh, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Mesh:
    return Mesh(mesh.points + np.array([x, y, z]), mesh.faces)


def in_units(mesh: Mesh, scale: float) -> Mesh:
    """From metres to a file's unit; rounded, so that the last bit of a sine changes no byte."""
    return Mesh((mesh.points / scale).round(6), mesh.faces)


def join(meshes: list[Mesh]) -> Mesh:
    starts = np.cumsum([0] + [len(mesh.points) for mesh in meshes[:-1]])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]
    return Mesh(np.vstack([mesh.points for mesh in meshes]), np.vstack(faces))


def wheel() -> Mesh:
    """An omni wheel, axle along y: a dished hub and two rows of rollers on tabs, set half a pitch
    apart.
    """
    pitch, row, w = 2 * np.pi / ROLLERS, ROLLER_RADIUS + 0.0025, WHEEL_WIDTH / 2
    face = [(0.028, w), (0.030, 0.035), (0.056, 0.035), (0.060, 0.056), (0.078, 0.056)]
    tab = turn(box((0.07, 0.124), 0.006, (-0.016, 0.016)), "z", pitch / 2)
    pieces = [lathe([(r, -z) for r, z in face] + face[::-1], 40)]
    for i in range(2 * ROLLERS):
        pieces.append(
            turn(shift(join([roller(), tab]), z=row if i % 2 else -row), "z", i * pitch / 2)
        )
    return in_units(turn(join(pieces), "x", np.pi / 2), WHEEL_SCALE)


def roller() -> Mesh:
    """A barrel on the rim at +x. Its outer line is the wheel's own circle, so the wheel rolls
    smoothly.
    """
    centre, half = WHEEL_RADIUS - ROLLER_RADIUS, ROLLER_LENGTH / 2
    profile = [
        ((WHEEL_RADIUS**2 - t**2) ** 0.5 - centre, t) for t in np.linspace(-half, half, 7).tolist()
    ]
    return shift(turn(lathe(profile, 16), "x", np.pi / 2), x=centre)


def base() -> list[tuple[str, Colour, Mesh]]:
    """The chassis: two plates around a battery, three motor arms, and a nose towards +x, the way
    forward.
    """
    corners = 0.36 * WHEELS / np.hypot(*WHEELS.T)[:, None]
    post = lathe([(0.016, 0.25), (0.016, 0.32)], 12)
    eye = shift(turn(lathe([(0.018, 0.39), (0.018, 0.405)], 16), "y", np.pi / 2), z=0.285)
    snout = rounded(np.array([(0.20, -0.10), (0.37, -0.05), (0.37, 0.05), (0.20, 0.10)]), 0.03, 32)
    head = extrude(np.array([(0.10, -0.11), (0.28, 0.0), (0.10, 0.11)]), 0.334, 0.342)
    parts: list[tuple[str, Colour, Mesh]] = [
        ("deck", ORANGE, extrude(rounded(corners, 0.11, 72), 0.315, 0.335)),
        ("plate", INK, extrude(rounded(corners, 0.13, 72), 0.232, 0.252)),
        ("posts", SILVER, join([shift(post, x, y) for x, y in [*corners, *-0.6 * corners]])),
        ("battery", BLUE, box((-0.17, 0.15), 0.26, (0.25, 0.305))),
        (
            "nose",
            WHITE,
            join([extrude(snout, 0.25, 0.317), head, box((-0.15, 0.11), 0.07, (0.334, 0.342))]),
        ),
        ("eyes", INK, join([shift(eye, y=0.045), shift(eye, y=-0.045)])),
        *arms(),
    ]
    return [
        (name, rgb, in_units(shift(mesh, z=-BASE_ORIGIN), BASE_SCALE)) for name, rgb, mesh in parts
    ]


def arms() -> list[tuple[str, Colour, Mesh]]:
    """To each wheel a beam with a plate at its end, and on it a motor: can, gear head, shaft to the
    wheel.
    """
    beam = join(
        [box((0.30, 0.585), 0.10, (0.228, 0.256)), box((0.570, 0.585), 0.12, (0.12, 0.256))]
    )
    steps = [
        (0.046, 0.38),
        (0.046, 0.50),
        (0.036, 0.50),
        (0.036, 0.57),
        (0.014, 0.57),
        (0.014, 0.614),
    ]
    motor = shift(turn(lathe(steps, 24), "y", np.pi / 2), z=AXLE_HEIGHT)
    angles = [float(np.arctan2(y, x)) for x, y in WHEELS]
    beams, motors = (join([turn(mesh, "z", angle) for angle in angles]) for mesh in (beam, motor))
    return [("beams", STEEL, beams), ("motors", SILVER, motors)]


def normals(mesh: Mesh) -> Array:
    """The outward unit normal of each face, (m, 3)."""
    a, b, c = (mesh.points[mesh.faces[:, i]] for i in range(3))
    n = np.cross(b - a, c - a)
    return np.asarray(n / np.sqrt((n * n).sum(axis=1, keepdims=True)))


def stl(mesh: Mesh) -> bytes:
    """Binary STL: an 80-byte title, the count, then normal, corners and a spare word per face."""
    rows = np.zeros(
        len(mesh.faces), dtype=[("n", "<f4", 3), ("p", "<f4", (3, 3)), ("spare", "<u2")]
    )
    rows["n"], rows["p"] = normals(mesh), mesh.points[mesh.faces]
    return (
        b"hb_bot omni wheel, axle along y".ljust(80) + struct.pack("<I", len(rows)) + rows.tobytes()
    )


def dae(parts: list[tuple[str, Colour, Mesh]]) -> bytes:
    """COLLADA 1.4.1, z up: for each part an effect (its colour), a material, a geometry and a
    node.
    """
    effects, materials, geometries, nodes = map(
        "".join, zip(*(elements(*p) for p in parts), strict=True)
    )
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><created>2024-01-01T00:00:00Z</created><modified>2024-01-01T00:00:00Z</modified>
<unit name="meter" meter="1"/><up_axis>Z_UP</up_axis></asset>
<library_effects>{effects}</library_effects>
<library_materials>{materials}</library_materials>
<library_geometries>{geometries}</library_geometries>
<library_visual_scenes><visual_scene id="scene">{nodes}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#scene"/></scene></COLLADA>
""".encode()


def elements(name: str, colour: Colour, mesh: Mesh) -> tuple[str, str, str, str]:
    """The part's effect, material, geometry and node. One normal per face keeps the edges sharp."""
    index = np.stack(
        [mesh.faces, np.repeat(np.arange(len(mesh.faces))[:, None], 3, axis=1)], axis=-1
    )
    effect = f"""
<effect id="{name}-e"><profile_COMMON><technique sid="common"><lambert><diffuse>
<color>{" ".join(map(str, colour))} 1</color></diffuse></lambert></technique></profile_COMMON></effect>"""  # noqa: E501
    material = f'\n<material id="{name}-m"><instance_effect url="#{name}-e"/></material>'
    geometry = f"""
<geometry id="{name}"><mesh>{source(name + "-p", mesh.points)}{source(name + "-n", normals(mesh))}
<vertices id="{name}-v"><input semantic="POSITION" source="#{name}-p"/></vertices>
<triangles count="{len(index)}" material="{name}"><input semantic="VERTEX" source="#{name}-v" offset="0"/>
<input semantic="NORMAL" source="#{name}-n" offset="1"/><p>{" ".join(map(str, index.ravel()))}</p></triangles>
</mesh></geometry>"""  # noqa: E501
    node = f"""
<node id="{name}-node"><instance_geometry url="#{name}"><bind_material><technique_common><instance_material
symbol="{name}" target="#{name}-m"/></technique_common></bind_material></instance_geometry></node>"""  # noqa: E501
    return effect, material, geometry, node


def source(name: str, rows: Array) -> str:
    numbers = " ".join(f"{x:g}" for x in rows.round(4).ravel() + 0.0)  # + 0.0 makes -0 a 0
    return f"""
<source id="{name}"><float_array id="{name}-a" count="{rows.size}">{numbers}</float_array><technique_common>
<accessor source="#{name}-a" count="{len(rows)}" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>"""  # noqa: E501


def logo(size: int = 512) -> Array:
    """Three wheels on a rounded triangle, and a wave that reads as a Z: (size, size, 4), 0 to 1."""
    axis = (np.arange(size) + 0.5) / size * 2 - 1
    # x right, y up; 0.15 centres the drawing
    spots = np.stack(np.meshgrid(axis, 0.15 - axis), axis=-1)
    image, t, ways = np.zeros((size, size, 4)), np.linspace(0, 1, 61), circle(3, 0.75)
    sides = np.max([-spots @ way for way in ways], axis=0) - 0.31
    for way in ways:
        paint(
            image,
            to_line(spots, 0.86 * way + np.outer([-0.16, 0.16], [-way[1], way[0]])) - 0.11,
            STEEL,
        )
    paint(image, np.copysign(to_line(spots, 0.62 * ways[[0, 1, 2, 0]]), sides) - 0.2, ORANGE)
    wave = np.stack([-0.24 * np.cos(3 * np.pi * t), 0.24 * np.cos(np.pi * t) + 0.02], axis=1)
    paint(image, to_line(spots, wave) - 0.06, WHITE)
    return image


def to_line(spots: Array, line: Array) -> Array:
    """How far each spot, (h, w, 2), is from a line through points, (n, 2)."""
    far = np.full(spots.shape[:2], np.inf)
    for start, way in zip(line[:-1], np.diff(line, axis=0), strict=True):
        along = ((spots - start) * way).sum(-1) / (way * way).sum()
        gap = spots - start - way * along.clip(0, 1)[..., None]
        far = np.minimum(far, np.sqrt((gap * gap).sum(-1)))
    return far


def paint(image: Array, outside: Array, colour: Colour) -> None:
    """Lay a colour where the distance is below zero; on the edge, a pixel wide, it is blended."""
    cover = (0.5 - outside * len(image) / 2).clip(0, 1)[..., None]
    below = image[..., 3:] * (1 - cover)
    image[..., :3] = (colour * cover + image[..., :3] * below) / np.maximum(cover + below, 1e-9)
    image[..., 3:] = cover + below


def png(image: Array) -> bytes:
    """8-bit RGBA, rows unfiltered."""
    rows = np.insert((image * 255).round().astype(np.uint8).reshape(len(image), -1), 0, 0, axis=1)
    header = struct.pack(">IIBBBBB", image.shape[1], image.shape[0], 8, 6, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b"")]
    packed = [
        struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in chunks
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(packed)


def main() -> None:
    parser = argparse.ArgumentParser(description="Makes base.dae, wheel.stl and logo.png.")
    parser.add_argument("outdir", nargs="?", type=Path, default=Path(__file__).parent)
    folder = parser.parse_args().outdir
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "base.dae").write_bytes(dae(base()))
        (folder / "wheel.stl").write_bytes(stl(wheel()))
        (folder / "logo.png").write_bytes(png(logo()))
    except OSError as error:
        parser.error(
            f"cannot write into {folder}: {error.strerror}; name a folder that may be written"
        )


if __name__ == "__main__":
    main()
