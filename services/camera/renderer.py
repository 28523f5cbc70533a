"""Renders what a camera sees, the visual shapes of all entities, by pybullet's TinyRenderer: no
graphics card.
"""

import contextlib
import math
import tempfile

import numpy as np
from PIL import Image

from holozen.messages import Exposure
from holozen.process import quiet
from holozen.robot.files.description import Appearance, Mesh
from holozen.robot.files.meshes import normals_of, write_stl
from holozen.robot.files.textures import Texture
from holozen.robot.model import Shape
from holozen.robot.rigid import Frame
from holozen.rotation import Transform, rotate

from .picture import GREY, GROUND, Picture

MAX_REMOVED = 100  # bodies that are removed before `renew` frees their memory
# triangles; the engine takes no more than 131,072 vertices of a mesh that is not in a file
AT_ONCE = 40_000
MISSED = 0.9999  # in the depth buffer: nothing was hit


with quiet():  # it prints its build time from C while it loads; no flag stops it
    import pybullet as bullet


class Renderer:
    """A scene with all entities, in the poses of the exposure that is rendered."""

    def __init__(self) -> None:
        self._begin()

    def _begin(self) -> None:
        self._world: int = bullet.connect(bullet.DIRECT)
        # number and, by link, bodies of each entity
        self._bodies: dict[str, tuple[int, dict[str, list[int]]]] = {}
        self._ground: int | None = None  # its body; None while there is none
        self._textures: dict[Texture, int] = {}
        self._removed = 0  # bodies; the engine frees almost none of their memory, 300 KB for a mesh

    def renew(self) -> None:
        """If many bodies have been removed, free their memory: start with an empty scene, which
        knows no entity.
        """
        if self._removed > max(MAX_REMOVED, len(self._bodies)):
            self.close()
            self._begin()

    def knows(self, name: str, number: int) -> bool:
        """Whether it knows what an entity looks like."""
        return name in self._bodies and self._bodies[name][0] == number

    def add(self, name: str, number: int, looks: Appearance) -> None:
        """Add an entity, or replace the one that had its name."""
        self.remove(name)
        links = {
            link.name: [
                body
                for shape, meshes in shapes
                for body in self._made(shape, meshes, looks.pictures)
            ]
            for link, shapes in looks.shapes()
        }
        self._bodies[name] = number, links

    def remove(self, name: str) -> None:
        """Remove an entity, if it is there."""
        _, links = self._bodies.pop(name, (0, {}))
        for bodies in links.values():
            for body in bodies:
                bullet.removeBody(body, self._world)
                self._removed += 1

    def render(self, exposure: Exposure) -> Picture:
        """The picture of an exposure."""
        self._place(exposure)
        camera, eye = exposure, Transform.of(exposure.pose.position, exposure.pose.orientation)
        ahead, up = eye.apply((1.0, 0.0, 0.0)), rotate(eye.rotation, (0.0, 0.0, 1.0))
        view = bullet.computeViewMatrix(eye.translation, ahead, up)
        across = math.tan(camera.field_of_view / 2)
        high = 2 * math.atan(across * camera.height / camera.width)
        near, far = camera.near, camera.far
        projection = bullet.computeProjectionMatrixFOV(
            math.degrees(high), camera.width / camera.height, near, far
        )
        # The engine draws half a pixel too far to the right and up.
        projection = list(projection)
        projection[8], projection[9] = 1 / camera.width, 1 / camera.height
        _, _, rgba, depth, _ = bullet.getCameraImage(
            camera.width,
            camera.height,
            view,
            projection,
            shadow=0,
            renderer=bullet.ER_TINY_RENDERER,
            flags=bullet.ER_NO_SEGMENTATION_MASK,
            physicsClientId=self._world,
        )
        size = camera.height, camera.width
        buffer = np.asarray(depth, np.float32).reshape(size)
        metres = np.where(
            buffer < MISSED, far * near / (far - (far - near) * buffer), np.inf
        ).astype(np.float32)
        return Picture(np.asarray(rgba, np.uint8).reshape(*size, 4)[..., :3], metres)

    def _place(self, exposure: Exposure) -> None:
        if exposure.ground and self._ground is None:
            (self._ground,) = self._made(GROUND)
        there = {entity.name for entity in exposure.entities}
        for name in [name for name in self._bodies if name not in there]:
            self.remove(name)
        for entity in exposure.entities:
            _, links = self._bodies.get(entity.name, (0, {}))
            for link, pose in zip(entity.links, entity.poses, strict=True):
                at = Transform.of(pose.position, pose.orientation)
                for body in links.get(link, ()):
                    bullet.resetBasePositionAndOrientation(
                        body, at.translation, at.rotation, self._world
                    )

    def _made(
        self, shape: Shape, meshes: tuple[Mesh, ...] = (), pictures: tuple[Texture, ...] = ()
    ) -> list[int]:
        """Make the bodies of a shape, in the frame of its link; none for a shape that cannot be
        drawn.
        """
        made = list[int]()
        for mesh in meshes:
            if picture := mesh.picture_of(pictures):
                made += self._textured(shape, mesh, picture)
            elif shape.kind == "mesh":
                made += self._body(self._visual(shape, mesh))
        return made if meshes or shape.kind == "mesh" else self._body(self._visual(shape))

    def _body(self, visual: int) -> list[int]:
        return (
            [bullet.createMultiBody(0, -1, visual, physicsClientId=self._world)]
            if visual >= 0
            else []
        )

    def _textured(self, shape: Shape, mesh: Mesh, picture: Texture) -> list[int]:
        """The bodies of a mesh with a picture on it: the engine takes AT_ONCE triangles of each."""
        frame, made = Frame.of(shape.pose), list[int]()
        try:
            (points, triangles), on_picture = mesh.arrays(), mesh.on_picture()
            texture = self._texture(picture)
        except ValueError:
            return []
        scale = shape.size if shape.kind == "mesh" else (1.0, 1.0, 1.0)
        corners = points[triangles].astype(np.float64) * scale
        if np.prod(scale) < 0:  # mirrored
            corners, triangles = corners[:, ::-1], triangles[:, ::-1]
        normals = np.repeat(normals_of(corners), 3, axis=0)
        for start in range(0, len(triangles), AT_ONCE):
            part = slice(start, start + AT_ONCE)
            with contextlib.suppress(bullet.error):
                visual = bullet.createVisualShape(
                    bullet.GEOM_MESH,
                    vertices=corners[part].reshape(-1, 3).tolist(),
                    indices=list(range(corners[part].shape[0] * 3)),
                    uvs=on_picture[triangles[part].ravel()].tolist(),
                    normals=normals[3 * start : 3 * (start + AT_ONCE)].tolist(),
                    rgbaColor=(1.0, 1.0, 1.0, 1.0),
                    visualFramePosition=frame.xyz,
                    visualFrameOrientation=frame.quaternion,
                    physicsClientId=self._world,
                )
                made += (body := self._body(visual))
                for number in body:
                    bullet.changeVisualShape(
                        number, -1, textureUniqueId=texture, physicsClientId=self._world
                    )
        return made

    def _texture(self, picture: Texture) -> int:
        """The engine's number of a picture. As of a mesh, it only ever reads a file that we have
        written. Raises ValueError if it has another size than it says.
        """
        if picture not in self._textures:
            with tempfile.NamedTemporaryFile(suffix=".bmp") as file:
                size = picture.width, picture.height
                Image.frombytes("RGB", size, picture.pixels).save(file, "BMP")
                file.flush()
                self._textures[picture] = bullet.loadTexture(file.name, physicsClientId=self._world)
        return self._textures[picture]

    def _visual(self, shape: Shape, mesh: Mesh | None = None) -> int:
        frame = Frame.of(shape.pose)
        common = {
            "rgbaColor": shape.color or (mesh and mesh.color) or GREY,
            "visualFramePosition": frame.xyz,
            "visualFrameOrientation": frame.quaternion,
            "physicsClientId": self._world,
        }
        match shape.kind:
            case "box":
                return int(
                    bullet.createVisualShape(
                        bullet.GEOM_BOX, halfExtents=[e / 2 for e in shape.size], **common
                    )
                )
            case "cylinder":
                radius, length = shape.size
                return int(
                    bullet.createVisualShape(
                        bullet.GEOM_CYLINDER, radius=radius, length=length, **common
                    )
                )
            case "sphere":
                return int(
                    bullet.createVisualShape(bullet.GEOM_SPHERE, radius=shape.size[0], **common)
                )
            case "mesh" if mesh:
                # The engine's own readers, which are in C++, only ever see this file, which we have
                # written.
                with (
                    contextlib.suppress(bullet.error, ValueError),
                    tempfile.NamedTemporaryFile(suffix=".stl") as file,
                ):
                    points, triangles = mesh.arrays()
                    file.write(write_stl(points[triangles.ravel()].astype(np.float64)))
                    file.flush()
                    scale = list(shape.size)
                    return int(
                        bullet.createVisualShape(
                            bullet.GEOM_MESH, fileName=file.name, meshScale=scale, **common
                        )
                    )
        return -1

    def close(self) -> None:
        """Free the engine."""
        bullet.disconnect(self._world)
