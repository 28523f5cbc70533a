"""URDF and SDF texts, and meshes, that are meant to do harm."""

import base64
import os
import struct
from collections.abc import Iterator
from pathlib import Path


def link(inside: str) -> str:
    return f'<robot name="r"><link name="a">{inside}</link></robot>'


def mesh(uri: str) -> str:
    return link(f'<collision><geometry><mesh filename="{uri}"/></geometry></collision>')


def sdf_mesh(uri: str) -> str:
    shape = f"<collision name='c'><geometry><mesh><uri>{uri}</uri></mesh></geometry></collision>"
    return f"<sdf version='1.6'><model name='m'><link name='a'>{shape}</link></model></sdf>"


ENTITIES = "".join(f'<!ENTITY e{n} "{f"&e{n - 1};" * 10}">' for n in range(1, 12))


def data(kind: str, content: bytes) -> str:
    return f"data:model/{kind};base64,{base64.b64encode(content).decode()}"


def stl(count: int, triangles: bytes = b"") -> bytes:
    return bytes(80) + struct.pack("<I", count) + triangles


COLLADA = (
    '<COLLADA><library_geometries><geometry id="g"><mesh><source id="s"><float_array '
    'count="99999999999">0'
    '</float_array></source><triangles count="99999999999"><input semantic="VERTEX" source="#s" '
    'offset="9999999"/>'
    "<p>0</p></triangles></mesh></geometry></library_geometries></COLLADA>"
)
HOSTILE = {
    "entity bomb": f'<!DOCTYPE r [<!ENTITY e0 "x">{ENTITIES}]><robot name="&e11;"><link '
    'name="a"/></robot>',
    "quadratic entity": f'<!DOCTYPE r [<!ENTITY a "{"x" * 100_000}">]><robot '
    f'name="{"&a;" * 10_000}"/>',
    "external entity": '<!DOCTYPE r [<!ENTITY x SYSTEM "file://{secret}">]>' + link("&x;"),
    "external subset": '<!DOCTYPE robot SYSTEM "file://{secret}">' + link(""),
    "parameter entity": '<!DOCTYPE r [<!ENTITY % p SYSTEM "file://{secret}"> %p;]>' + link(""),
    "stylesheet": '<?xml-stylesheet href="file://{secret}"?>' + link(""),
    "xinclude": link(
        '<x:include xmlns:x="http://www.w3.org/2001/XInclude" href="{secret}" parse="text"/>'
    ),
    "other encoding": '<?xml version="1.0" encoding="utf-7"?>' + link(""),
    "many elements": link("<visual/>" * 400_000),
    "deep elements": link("<a>" * 100_000),
    "many attributes": "<robot " + " ".join(f"a{n}='1'" for n in range(200_000)) + "/>",
    "long attribute": f'<robot name="{"n" * 3_900_000}"><link name="a"/></robot>',
    "long text": f"<robot name='r'>{'x' * 10_000_000}</robot>",
    "long number": link(f'<inertial><mass value="{"9" * 1_000_000}"/></inertial>'),
    "many joints": "<robot name='r'><link name='l0'/>"
    + "".join(
        f"<link name='l{n}'/><joint name='j{n}' type='fixed'><parent link='l{n - 1}'/><child "
        f"link='l{n}'/></joint>"
        for n in range(1, 12_000)
    )
    + "</robot>",
    "cycle of joints": "<robot name='r'><link name='a'/><link name='b'/>"
    + "".join(
        f"<joint name='{p}' type='fixed'><parent link='{p}'/><child link='{c}'/></joint>"
        for p, c in ("ab", "ba")
    )
    + "</robot>",
    "not finite": link(
        '<inertial><mass value="nan"/><inertia ixx="inf" iyy="-1" izz="1e308"/></inertial>'
    ),
    "huge box": link('<collision><geometry><box size="1e308 1e308 1e308"/></geometry></collision>'),
    "model in itself": "<sdf version='1.6'><include><uri>model://bot</uri></include></sdf>",
    "include by path": "<sdf version='1.6'><include><uri>file://{secret}</uri></include></sdf>",
    "include by the network": "<sdf "
    "version='1.6'><include><uri>https://127.0.0.1/m.sdf</uri></include></sdf>",
    "deep models": "<sdf version='1.6'>" + "<model name='m'>" * 5_000,
    "mesh by file://": mesh("file://{secret}"),
    "mesh by path": mesh("{secret}"),
    "mesh by .. in a package": mesh("package://bot/../secret.stl"),
    "mesh by .. before a package": mesh("package://../secret.stl"),
    "mesh by quoted ..": mesh("package://bot/%2e%2e/secret.stl"),
    "mesh by a link": mesh("package://bot/link.stl"),
    "mesh by a linked folder": mesh("package://bot/folder/secret.stl"),
    "mesh by /proc": mesh("package://bot/../../../../../../proc/self/environ"),
    "mesh by NUL": mesh("package://bot/link.stl&#0;"),
    "mesh by a device": mesh("file:///dev/zero"),
    "mesh by a fifo": mesh("package://bot/fifo.stl"),
    "mesh by the network": mesh("http://127.0.0.1:9/mesh.stl"),
    "SDF mesh by file://": sdf_mesh("file://{secret}"),
    "SDF mesh by .. in a model": sdf_mesh("model://bot/../secret.stl"),
    "STL of 4e9 triangles": mesh(data("stl", stl(2**32 - 1))),
    "STL of NaN": mesh(data("stl", stl(1, struct.pack("<12fH", *[float("nan")] * 12, 0)))),
    "STL that is huge": mesh(data("stl", stl(1, struct.pack("<12fH", *[3e38] * 12, 0)))),
    "texture by path": link(
        '<visual><geometry><box size="1 1 1"/></geometry><material name="m"><texture '
        'filename="{secret}"/></material>'
        "</visual>"
    ),
    "name of a path": '<robot name="../../etc"><link name="/etc/passwd"/></robot>',
    "plugin of a path": link("").replace(
        "</robot>", '<gazebo><plugin name="p" filename="{secret}"/></gazebo></robot>'
    ),
    "base64 that is none": mesh("data:model/stl;base64,%%%%"),
}
"""What a text is -> the text."""

MESHES = {
    "count.stl": stl(2**32 - 1),
    "far.stl": stl(1, struct.pack("<12fH", *[3e38] * 12, 0)),
    "endless.stl": b"solid x\n" + b"facet " * 300_000,
    "words.stl": b"solid x\n facet outer loop vertex 1 a " + b"9" * 300_000 + b" endloop",
    "far.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999\n",
    "below.obj": b"v 0 0 0\nf -1 -2 -99999999999999\n",
    "line.obj": b"f " + b"1 " * 1_000_000,
    "bomb.dae": f'<!DOCTYPE r [<!ENTITY e0 "x">{ENTITIES}]><COLLADA>&e11;</COLLADA>'.encode(),
    "external.dae": b'<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><COLLADA>&x;</COLLADA>',
    "count.dae": COLLADA.encode(),
    "deep.dae": b"<COLLADA>" + b"<node>" * 100_000,
    "unit.dae": b"<COLLADA><asset><unit meter='1e308'/></asset></COLLADA>",
}
"""Files of a known package."""


def laid_out(folder: Path) -> tuple[Path, Iterator[tuple[str, str]]]:
    """A package with these meshes, links and a fifo, beside a private file; and the name and text
    of each robot.
    """
    package, secret = folder / "bot", folder / "secret.stl"
    secret.write_bytes(stl(2, struct.pack("<12fH", *range(12), 0) * 2))
    package.mkdir()
    (package / "package.xml").write_text("<package><name>bot</name></package>")
    (package / "model.sdf").write_text(HOSTILE["model in itself"])
    (package / "link.stl").symlink_to(secret)
    (package / "folder").symlink_to(folder)
    os.mkfifo(package / "fifo.stl")
    for file, content in MESHES.items():
        (package / file).write_bytes(content)
    texts = HOSTILE | {file: mesh(f"package://bot/{file}") for file in MESHES}
    return package, ((name, text.replace("{secret}", str(secret))) for name, text in texts.items())
