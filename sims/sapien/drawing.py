"""SAPIEN's renderer: a scene of its own, without physics, that follows the simulated one.

Drawing needs a Vulkan device, which simulating does not. Apart from it the simulated scene is the
same with and without a picture, and a restore may build it anew under an open window.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.scene import Pose, Scene, Solid
from pytest_simbench.simulator import PreparedRobot, UnavailableError, lazy_import
from pytest_simbench.simulator.base import EYE, FIELD_OF_VIEW, view_axes

sapien = lazy_import("sapien")
rendering = lazy_import("sapien.render")
viewing = lazy_import("sapien.utils.viewer")

NEAR, FAR = 0.1, 100.0
"""What the camera sees [m]."""

LINK_COLOUR, GROUND_COLOUR = (0.9, 0.9, 0.9, 1.0), (0.4, 0.45, 0.5, 1.0)

UPRIGHT = Pose(quaternion=(math.sqrt(0.5), 0.0, -math.sqrt(0.5), 0.0))
"""Turns the x axis, along which SAPIEN's cylinders and capsules lie and its planes face, to the z
axis."""

NO_VULKAN = (
    "SAPIEN draws with Vulkan and finds no device for it ({error}); it takes a graphics card's "
    "driver, or Mesa's software driver from 24.3 on: apt-get install mesa-vulkan-drivers, on "
    "Debian 12 from bookworm-backports"
)


class Drawing:
    """What a scene looks like, in a window and in pictures.

    Args:
        scene: its boxes are drawn, and the ground.
        prepared: its links are drawn, by their collision shapes.

    Raises:
        UnavailableError: there is no Vulkan device.
    """

    def __init__(self, scene: Scene, prepared: PreparedRobot | None) -> None:
        try:
            system = rendering.RenderSystem()
        except RuntimeError as error:
            raise UnavailableError(NO_VULKAN.format(error=error)) from None
        self._world = sapien.Scene([system])
        self._world.set_ambient_light([0.4] * 3)
        self._world.add_directional_light([-0.5, -0.3, -1.0], [1.0] * 3, shadow=True)
        self._entities: dict[str, Any] = {}
        self._add_ground()
        for box in scene.bodies:
            solids = [self._solid(solid, box.colour) for solid in box.solids()]
            self._add(box.name, solids).set_pose(to_sapien(box.pose))
        for link in () if prepared is None else prepared.links.values():
            shapes = [
                self._solid(Solid("box", shape.size, shape.pose), LINK_COLOUR)
                if shape.size is not None
                else self._mesh(str(shape.mesh), shape.pose)
                for shape in link.shapes
            ]
            self._add(link.name, shapes)
        self._camera: Any = None
        self._viewer: Any = None
        self._layout: tempfile.TemporaryDirectory[str] | None = None

    def _add(self, name: str, shapes: list[Any]) -> Any:
        entity, component = sapien.Entity(), rendering.RenderBodyComponent()
        entity.name = name
        for shape in shapes:
            component.attach(shape)
        entity.add_component(component)
        self._world.add_entity(entity)
        self._entities[name] = entity
        return entity

    def _add_ground(self) -> None:
        size = np.array([0.0, 10.0, 10.0])
        shape = rendering.RenderShapePlane(size, _material(GROUND_COLOUR))
        self._add("ground", [shape]).set_pose(to_sapien(UPRIGHT))

    def _solid(self, solid: Solid, colour: tuple[float, ...]) -> Any:
        x, _, z = half = np.array(solid.extents) / 2
        material, pose = _material(colour), solid.pose
        if solid.kind == "box":
            shape = rendering.RenderShapeBox(half, material)
        elif solid.kind == "ball":
            shape = rendering.RenderShapeSphere(x, material)
        elif solid.kind == "mesh":
            shape = _triangles(solid, material)
        else:
            shape, pose = rendering.RenderShapeCylinder(x, z, material), pose * UPRIGHT
        shape.local_pose = to_sapien(pose)
        return shape

    def _mesh(self, path: str, pose: Pose) -> Any:
        shape = rendering.RenderShapeTriangleMesh(path, np.ones(3), _material(LINK_COLOUR))
        shape.local_pose = to_sapien(pose)
        return shape

    def follow(self, poses: Mapping[str, Any]) -> None:
        """Put bodies and links, by name, where the simulated ones are (SAPIEN poses)."""
        for name, pose in poses.items():
            self._entities[name].set_pose(pose)
        self._world.update_render()

    def picture(self, width: int, height: int) -> NDArray[np.uint8]:
        """What the camera sees, (height, width, 3), RGB."""
        if self._camera is None or (self._camera.width, self._camera.height) != (width, height):
            self._camera = self._world.add_camera("eye", width, height, FIELD_OF_VIEW, NEAR, FAR)
            self._camera.entity.set_pose(_looking())
            self._world.update_render()
        self._camera.take_picture()
        colours = self._camera.get_picture("Color")[..., :3]
        return np.asarray(np.clip(colours, 0.0, 1.0) * 255, dtype=np.uint8)

    def show(self) -> None:
        """Draw the window, which is opened the first time; nothing once the user has closed it."""
        if self._viewer is None:
            # The viewer leaves its panels' layout in a file, by default in the working folder.
            self._layout = tempfile.TemporaryDirectory(prefix="simbench-sapien-")
            rendering.set_imgui_ini_filename(f"{self._layout.name}/imgui.ini")
            # Of its panels the one for the camera; the others would cover the scene, and tell of a
            # physics that is not here.
            self._viewer = viewing.Viewer(
                resolutions=(1280, 720), plugins=[viewing.control_window.ControlWindow()]
            )
            self._viewer.set_scene(self._world)
            self._viewer.window.set_camera_parameters(NEAR, FAR, FIELD_OF_VIEW)
            self._viewer.set_camera_pose(_looking())
        if not self._viewer.closed:
            self._viewer.render()

    def close(self) -> None:
        """Close the window."""
        if self._viewer is not None and not self._viewer.closed:
            self._viewer.close()
        self._viewer = self._camera = None
        if self._layout is not None:
            self._layout.cleanup()


def _triangles(solid: Solid, material: Any) -> Any:
    """Each triangle with corners of its own, so that the edges between flat faces are sharp."""
    vertices, triangles = (np.array(rows) for rows in solid.mesh)
    corners = vertices[triangles].reshape(-1, 3).astype(np.float32)
    sides = corners.reshape(-1, 3, 3)
    normals = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return rendering.RenderShapeTriangleMesh(
        corners,
        np.arange(len(corners), dtype=np.uint32).reshape(-1, 3),
        np.repeat(normals, 3, axis=0).astype(np.float32),
        np.zeros((len(corners), 2), dtype=np.float32),
        material,
    )


def _material(colour: tuple[float, ...]) -> Any:
    material = rendering.RenderMaterial()
    material.base_color = colour
    material.roughness, material.specular = 0.8, 0.2
    return material


def to_sapien(pose: Pose) -> Any:
    """A pose of SAPIEN."""
    return sapien.Pose(pose.position, pose.quaternion)


def _looking() -> Any:
    """From the eye to the target; SAPIEN's cameras look along x, with z up."""
    (right, down, ahead), matrix = view_axes().T, np.eye(4)
    matrix[:3] = np.column_stack([ahead, -right, -down, EYE])
    return sapien.Pose(matrix)
