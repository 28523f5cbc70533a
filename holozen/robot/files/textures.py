"""Textures: the images that mesh files, URDF and Gazebo's materials name, embedded as text and
decoded to pixels.

Images are decoded only in the processes that read files, see `reader.py`.
"""

import base64
import binascii
import io
import os
import re
import zipfile
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from urllib.parse import unquote

import numpy as np
from msgspec import Struct

from holozen.packages import known_folders, lies_in, without_home
from holozen.robot.errors import RobotError
from holozen.robot.files.elements import Source, Tag, number
from holozen.robot.files.meshes import KINDS, MAX_SHOWN, Surface, file_in, read_surfaces
from holozen.robot.files.uris import is_data, named_folders, resolve_uri
from holozen.suggest import cut

FORMATS = {
    ".png": "png",
    ".jpg": "jpeg",
    ".jpeg": "jpeg",
    ".bmp": "bmp",
    ".tga": "tga",
    ".gif": "gif",
}
MAX_FILE = 40_000_000  # bytes of an image file
MAX_PIXELS = 100_000_000  # of an image file
# bytes of an image that is embedded as it is; a larger one is embedded as a JPEG
MAX_SENT = 600_000
WIDEST = 2048  # pixels along the longer side of an image that is drawn
QUALITY = 90  # of that JPEG, from 1 to 95
MAX_IMAGES = 32  # of one mesh
# the stem of the mesh's name in a bundle; all others are named as the mesh file names them
MESH = "mesh"

_IMAGE = re.compile(r"data:image/[a-z+-]+;base64,", re.IGNORECASE)
_BUNDLE = re.compile(r"data:model/(vnd\.collada\+xml|obj)\+zip;base64,")
_INIT_FROM = re.compile(rb"<init_from>\s*(?:<ref>\s*)?([^<>]+?)\s*<")
_LIBRARY = re.compile(rb"^[ \t]*mtllib[ \t]+(.+?)[ \t\r]*$", re.MULTILINE)
_MAP = re.compile(r"^[ \t]*map_Kd[ \t]+(.*?)[ \t\r]*$", re.MULTILINE | re.IGNORECASE)
_OPTION = re.compile(
    r"-(?:o|s|t)(?:\s+[-+\d.eE]+){1,3}\s+|-(?:blendu|blendv|cc|clamp)\s+(?:on|off)\s+|-\w+\s+\S+\s+"
)


class Texture(Struct, frozen=True):
    """An image: `pixels` are red, green, blue bytes, row by row from the top."""

    width: int
    height: int
    pixels: bytes

    @property
    def mean(self) -> tuple[float, float, float, float]:
        """Its mean colour: red, green, blue, alpha from 0 to 1."""
        red, green, blue = (
            np.frombuffer(self.pixels, np.uint8).reshape(-1, 3).mean(axis=0) / 255
        ).tolist()
        return red, green, blue, 1.0


# Files -> text.


@lru_cache
def image_uri(path: Path) -> str:
    """An image file as a `data:` URI; a large one is made smaller. Raises RobotError."""
    kind = FORMATS.get(os.path.splitext(os.path.realpath(path))[1].lower())
    if kind is None:
        raise RobotError(f"{path}: is not a supported image; use a {', '.join(FORMATS)} file")
    return f"data:image/{kind};base64,{base64.b64encode(_image(path)).decode()}"


def _image(path: Path) -> bytes:
    """The content of an image file, or if that is large, a JPEG. Raises RobotError."""
    try:
        if not path.is_file() or path.stat().st_size > MAX_FILE:
            raise RobotError(f"{path}: an image is a file of up to {MAX_FILE / 1e6:.0f} MB")
        content = path.read_bytes()
    except OSError as error:
        raise RobotError(f"{path}: {error.strerror}") from None
    if len(content) <= MAX_SENT:
        return content
    from PIL import Image

    picture, file = _decoded(content, str(path)), io.BytesIO()
    Image.frombytes("RGB", (picture.width, picture.height), picture.pixels).save(
        file, "JPEG", quality=QUALITY
    )
    return file.getvalue()


def mesh_uri(path: Path, source: Source) -> str:
    """A visual mesh as a `data:` URI, together with the materials and images that it refers to and
    that are beside it or in a known folder; empty if it refers to none. Raises RobotError.
    """
    suffix = path.suffix.lower()
    if suffix not in (".dae", ".obj") or not 0 < path.stat().st_size <= MAX_SHOWN:
        return ""
    content = path.read_bytes()
    files = dict(_references(suffix, content, path, source))
    if not any(os.path.splitext(name)[1].lower() in FORMATS for name in files):
        return ""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as bundle:
        for name, data in {MESH + suffix: content, **files}.items():
            bundle.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    return f"data:model/{KINDS[suffix]}+zip;base64,{base64.b64encode(packed.getvalue()).decode()}"


def _references(
    suffix: str, content: bytes, path: Path, source: Source
) -> Iterator[tuple[str, bytes]]:
    """The materials and images that a mesh refers to, by the names that it has for them."""
    if suffix == ".dae":
        names = [found.decode("utf-8", "replace") for found in _INIT_FROM.findall(content)]
    else:
        names = []
        for library in _LIBRARY.findall(content)[:MAX_IMAGES]:
            name = library.decode("utf-8", "replace")
            if (file := _beside(path, name, source)) and file.stat().st_size < MAX_SENT:
                text = file.read_bytes()
                yield name, text
                names += [
                    _OPTION.sub("", words)
                    for words in _MAP.findall(text.decode("utf-8", "replace"))
                ]
    for name in list(dict.fromkeys(names))[:MAX_IMAGES]:
        if os.path.splitext(name)[1].lower() in FORMATS:
            if (file := _beside(path, name, source)) is None:
                source.warnings.append(
                    f"{path}: there is no texture {cut(name)} beside it; it is drawn without it"
                )
                continue
            try:
                yield name, _image(file)
            except (RobotError, ImportError) as error:
                source.warnings.append(f"{path}: the texture {cut(name)} is not drawn: {error}")


def _beside(mesh: Path, name: str, source: Source) -> Path | None:
    """The file that a mesh file names: by that name, or in a folder of textures near it, but
    nowhere else.
    """
    plain = unquote(name.strip().removeprefix("file://")).replace("\\", "/")
    last = plain.rpartition("/")[2]
    folder = mesh.parent
    near = (
        folder,
        folder.parent / "materials" / "textures",
        folder.parent / "textures",
        folder.parent,
    )
    roots = without_home([folder, folder.parent, *known_folders(source.origin, source.packages)])
    places = (folder / plain, *(place / last for place in near))
    return next(
        (place for place in places if os.path.isfile(place) and lies_in(place, roots)), None
    )


# The texture of a material in URDF and SDF.


def texture_of(material: Tag, source: Source) -> str:
    """The image of a `<material>` as a `data:` URI: URDF's `<texture>`, gz-sim's `<albedo_map>`, or
    the one that a Gazebo script names; empty if it has none, or one that cannot be read, which
    causes a warning.
    """
    texture, map_ = material.first("texture"), next(material.below("albedo_map"), None)
    if texture is not None and texture.attributes.get("filename", "").strip():
        return _named_image(texture, texture.attributes["filename"].strip(), source)
    if map_ is not None and map_.text.strip():
        return _named_image(map_, map_.text.strip(), source)
    script = material.first("script")
    return _of_script(script, source) if script is not None else ""


def _named_image(tag: Tag, uri: str, source: Source) -> str:
    if is_data(uri):
        return uri
    if source.confined:
        return ""
    try:
        return image_uri(_allowed(resolve_uri(uri, source.origin, source.packages), source))
    except (RobotError, ImportError) as error:
        source.warn(tag, f"is a texture that is not drawn: {error}")
        return ""


def _allowed(path: Path, source: Source) -> Path:
    folder = Path(os.path.abspath(source.origin)).parent
    if not lies_in(
        path,
        [*without_home([folder, folder.parent]), *known_folders(source.origin, source.packages)],
    ):
        raise RobotError(
            f"{path}: an image has to be in the folder of the file, or in a known package"
        )
    return path


def _of_script(script: Tag, source: Source) -> str:
    """The image that the script of a Gazebo material names first."""
    uris = [tag.text.strip() for tag in script.all("uri")]
    if uris and _IMAGE.match(uris[0]):
        return uris[0]
    name = (script.first("name") or script).text.strip()
    if source.confined or not uris or not name:
        return ""
    folders = [folder for uri in uris for folder in _folders(uri, source)]
    scripts = [file for folder in folders for file in sorted(folder.glob("*.material"))]
    for file in scripts:
        try:
            image = script_image(_allowed(file, source).read_text("utf-8", "replace"), name)
        except (OSError, RobotError):
            continue
        for folder in (*folders, file.parent, file.parent.parent / "textures") if image else ():
            if os.path.isfile(folder / image):
                return _named_image(script, str(folder / image), source)
        if image:
            source.warn(
                script,
                f"names the texture {cut(image)}, which is in none of its folders; it is not drawn",
            )
            return ""
    return ""


def _folders(uri: str, source: Source) -> list[Path]:
    """The folder that a script's URI names, or that of the file which it names."""
    scheme, _, rest = uri.rpartition("://")
    name, _, inside = unquote(rest).strip("/").partition("/")
    folder = Path(os.path.abspath(source.origin)).parent
    places = [folder / unquote(rest)] if scheme in ("", "file") else []
    if scheme in ("model", "package"):
        places += [place / inside for place in named_folders(name, source.origin, source.packages)]
    return [place if place.is_dir() else place.parent for place in places if place.exists()]


def script_image(text: str, material: str) -> str:
    """The first image in an Ogre script that a material in it uses; empty if there is none."""
    text = re.sub(r"//[^\n]*|/\*.*?\*/", "", text, flags=re.DOTALL)
    start = re.search(
        rf"^\s*material\s+\"?{re.escape(material)}\"?\s*(?::[^\n{{]*)?\{{", text, re.MULTILINE
    )
    if start is None:
        return ""
    depth = 1
    for found in re.finditer(r"[{}]|(?<![\w])texture\s+([^\s{}]+)", text[start.end() :]):
        depth += {"{": 1, "}": -1}.get(found[0], 0)
        if depth == 0:
            return ""
        if found[1]:
            return found[1].strip('"')
    return ""


# Text -> pixels.


def picture_in(uri: str) -> Texture:
    """The image in a `data:` URI. Raises RobotError."""
    head = _IMAGE.match(uri.lstrip())
    if head is None:
        raise RobotError(f"{cut(uri)} holds no image; write data:image/png;base64,...")
    try:
        return _decoded(base64.b64decode(uri.lstrip()[head.end() :], validate=True), "image")
    except (binascii.Error, ValueError):
        raise RobotError(f"{cut(uri)} is not valid base64") from None


def _decoded(content: bytes, place: str) -> Texture:
    """The pixels of an image, at most WIDEST along its longer side. What is transparent is white.
    Raises RobotError.
    """
    from PIL import Image

    try:
        image: Image.Image = Image.open(
            io.BytesIO(content), formats=[kind.upper() for kind in {*FORMATS.values()}]
        )
        if image.width * image.height > MAX_PIXELS:
            raise RobotError(
                f"{place}: has {image.width} x {image.height} pixels; at most {MAX_PIXELS} are read"
            )
        if image.has_transparency_data:
            image = Image.alpha_composite(
                Image.new("RGBA", image.size, (255, 255, 255, 255)), image.convert("RGBA")
            )
        image = image.convert("RGB")
        image.thumbnail((WIDEST, WIDEST))
    except (OSError, ValueError, SyntaxError, EOFError, Image.DecompressionBombError) as error:
        raise RobotError(f"{place}: is not an image that can be read: {error}") from None
    return Texture(image.width, image.height, image.tobytes())


def surfaces_in(uri: str) -> Iterator[tuple[Surface, Texture | None]]:
    """The triangles of the mesh in a URI of `file_uri` or `mesh_uri`, and the image that is drawn
    on them. Raises RobotError.
    """
    if not _BUNDLE.match(uri.lstrip()):
        yield from ((surface, None) for surface in read_surfaces(*file_in(uri)))
        return
    suffix, content, files = _unpacked(uri.lstrip())
    materials = _materials(files) if suffix == ".obj" else {}
    pictures: dict[str, Texture | None] = {"": None}
    for surface in read_surfaces(suffix, content):
        color, image = materials.get(surface.material, (surface.color, surface.image))
        if image not in pictures:
            try:
                pictures[image] = _decoded(files[image], image)
            except (KeyError, RobotError, ImportError):
                pictures[image] = None
        yield Surface(surface.points, surface.triangles, color, surface.uv), pictures[image]


def _unpacked(uri: str) -> tuple[str, bytes, dict[str, bytes]]:
    """The suffix and content of the mesh in a bundle, and its other files by name. Raises
    RobotError.
    """
    head = _BUNDLE.match(uri)
    assert head is not None
    try:
        with zipfile.ZipFile(
            io.BytesIO(base64.b64decode(uri[head.end() :], validate=True))
        ) as bundle:
            if (
                sum(info.file_size for info in bundle.infolist())
                > MAX_SHOWN + MAX_IMAGES * MAX_FILE
            ):
                raise RobotError(f"{cut(uri)} holds too much")
            files = {
                info.filename: bundle.read(info) for info in bundle.infolist()[: 2 * MAX_IMAGES]
            }
    except (
        binascii.Error,
        ValueError,
        zipfile.BadZipFile,
        OSError,
        EOFError,
        NotImplementedError,
    ) as error:
        raise RobotError(f"{cut(uri)} is not valid: {error}") from None
    suffix = next((suffix for suffix in KINDS if MESH + suffix in files), "")
    if not suffix:
        raise RobotError(f"{cut(uri)} holds no mesh")
    return suffix, files.pop(MESH + suffix), files


def _materials(
    files: Mapping[str, bytes],
) -> dict[str, tuple[tuple[float, float, float, float] | None, str]]:
    """The colour and the image of each material in the .mtl files among some."""
    found: dict[str, tuple[tuple[float, float, float, float] | None, str]] = {}
    for name, content in files.items():
        if os.path.splitext(name)[1].lower() in FORMATS:
            continue
        for part in re.split(
            r"^[ \t]*newmtl[ \t]+", content.decode("utf-8", "replace"), flags=re.MULTILINE
        )[1:]:
            material, _, text = part.partition("\n")
            image = _MAP.search(text)
            found.setdefault(
                material.strip(), (_diffuse(text), _OPTION.sub("", image[1]) if image else "")
            )
    return found


def _diffuse(text: str) -> tuple[float, float, float, float] | None:
    words = re.search(r"^[ \t]*Kd[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", text, re.MULTILINE)
    values = [number(word) for word in words.groups()] if words else []
    known = [value for value in values if value is not None and 0 <= value <= 1]
    return (known[0], known[1], known[2], 1.0) if len(known) == 3 else None
