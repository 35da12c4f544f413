"""PhysX with one USD stage: its start and end, and what its sessions and rays can tell.

Sessions take 0.4 ms in Python, so they are not for stepping. Unlike tensor bindings they never run
a step of their own, so they are what may be used before the first one. They count in degrees.
"""

from __future__ import annotations

import math
import tempfile
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.description.shapes import DIRECTIONS
from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.scene.pose import turn_of_z
from pytest_simbench.simulator import lazy_import

ovphysx = lazy_import("ovphysx")
ovphysx_types = lazy_import("ovphysx.types")
ovstage = lazy_import("ovstage")
schema_support = lazy_import("ovphysx.samples.python_samples.schema_support")

REACH = 5.0
"""How far outside a body the rays begin that measure it [m]."""

_SPAN, _FLAT = 1.0, 0.05
"""Half edges of the flat box that measures a link, and from how far away it does [m]."""

_EVENTS = (
    "contactEventOtherBody",
    "contactEventSensorSide",
    *(
        f"contactEvent{kind}{what}"
        for kind in ("Point", "Anchor")
        for what in ("Count", "Position", "Impulse")
    ),
)
"""Of each contact: whom a prim touches, and impulses along the normal and of friction."""

_WITHOUT_SERVICE = {"/UJITSO/enabled": False}
"""PhysX's service that cooks meshes, and keeps them for other processes, polls: a quarter of a core
for as long as the process lives. Without it hulls and motions have the same bits."""

_registered = False


class Session:
    """PhysX, on the processor, simulating one stage.

    Args:
        text: the stage, `.usda`.
        threads: workers of PhysX; 0 computes in the calling thread.
    """

    def __init__(self, text: str, threads: int) -> None:
        # Deprecated calls are made on purpose, and that Warp could use a GPU is no trouble.
        warnings.filterwarnings("ignore", category=DeprecationWarning, module="pytest_simbench")
        warnings.filterwarnings("ignore", message="ovphysx is in CPU-only mode")
        ovphysx.PhysX.set_cpu_mode(True)
        ovphysx.set_global_config(ovphysx_types.GlobalConfigKey.NUM_THREADS, threads)
        config = ovphysx.PhysXConfig(carbonite_overrides=_WITHOUT_SERVICE)
        self.physx = ovphysx.PhysX(config=config)
        self._stage = None
        try:
            _register_schemas()
            self._stage = stage = ovstage.Stage("simbench")
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "scene.usda"
                path.write_text(text, encoding="utf-8")
                domains = ovstage.PopulationDomain.PHYSICS
                ovstage.population.open_usd(stage, str(path), ordinal=1, domains=domains)
            stage.advance_write_floor(ordinal=1).wait()
            self.physx.wait_task(self.physx.attach_ovstage(stage, read_ordinal=1))
        except Exception:
            self.close()
            raise

    def close(self) -> None:
        """End PhysX; bindings must have been destroyed."""
        if self._stage is not None:
            if self.physx.is_stage_attached(self._stage):
                self.physx.wait_task(self.physx.detach_ovstage())
            self._stage.destroy()
        self.physx.destroy()

    def read(self, kind: str, *attributes: str) -> dict[str, dict[str, FloatArray]]:
        """Attributes of all objects of a kind (`SimObjectType`), by attribute and prim path."""
        found: dict[str, dict[str, FloatArray]] = {name: {} for name in attributes}
        with self._reading(kind, attributes) as result:
            for group in result.groups:
                paths = result.dictionary.get_path_strings(group.prim_list)
                columns = [np.array(tensor.numpy(), dtype=float) for tensor in group.tensors]
                rows = columns if group.is_array else columns[0]
                name = result.dictionary.token_to_string(group.attribute)
                found[name].update(zip(paths, rows, strict=True))
        return found

    def _reading(self, kind: str, attributes: Sequence[str]) -> Any:
        target = getattr(ovphysx_types.SimObjectType, kind)
        scope = ovphysx_types.ObjectScope.ALL
        return self.physx.read_sync(target, list(attributes), scope=scope)

    def contacts(self) -> dict[tuple[str, str], list[tuple[FloatArray, FloatArray]]]:
        """What two prims do to each other in the last step: an impulse [N s] on the first of a pair
        and where it acts [m], for each point of contact and each anchor of friction."""
        found: dict[tuple[str, str], list[tuple[FloatArray, FloatArray]]] = {}
        values: dict[str, dict[str, Any]] = {name: {} for name in _EVENTS}
        with self._reading("CONTACT_SENSOR", _EVENTS) as result:
            for group in result.groups:
                paths = result.dictionary.get_path_strings(group.prim_list)
                arrays = [np.array(tensor.numpy()) for tensor in group.tensors]
                name = result.dictionary.token_to_string(group.attribute)
                values[name].update(zip(paths, arrays, strict=True))
            for sensor, others in values["contactEventOtherBody"].items():
                told = {name: array[sensor] for name, array in values.items() if sensor in array}
                for pair, points in _events(sensor, others, told, result.dictionary):
                    if pair[::-1] not in found:  # else it was told by the other one
                        found.setdefault(pair, []).extend(points)
        return found

    def write(self, kind: str, attribute: str, values: Mapping[str, Any]) -> None:
        """Set an attribute of all objects of a kind (`SimObjectType`), by prim path; 0 where none
        is given."""
        dictionary = ovstage.PathDictionary(self._stage)
        target = getattr(ovphysx_types.SimObjectType, kind)
        with self.physx.write_sync(target, attribute) as session:
            for group in session.groups:
                paths = dictionary.get_path_strings(group.prim_list)
                rows = [tensor.numpy() for tensor in group.tensors]
                if len(rows) < len(paths):  # one tensor of all
                    rows = [*rows[0]]
                for path, row in zip(paths, rows, strict=True):
                    row[...] = values.get(path, 0.0)
                session.commit_sync(group)

    def size(self, collider: str, pose: Pose) -> FloatArray:
        """Extents of a box along the axes of its body at `pose`, by rays from outside [m].

        Where a ray misses it is nan.
        """
        centre, size = np.asarray(pose.position), np.full(3, np.nan)
        for k, axis in enumerate(pose.rotation().T):
            ends = [self._ray(collider, centre + s * REACH * axis, -s * axis) for s in (1, -1)]
            if all(ends):
                size[k] = np.subtract(ends[0][0]["position"], ends[1][0]["position"]) @ axis
        return size

    def reach(self, collider: str, pose: Pose, aim: Pose, span: float = _SPAN) -> FloatArray:
        """How far a collider reaches in each of `DIRECTIONS`, in the frame at `pose`, (26,) [m].

        Args:
            pose: of the frame, in the world.
            aim: a point in or near the collider, in the frame.
            span: half edge of the box, and from how far away it comes [m]: more than the collider
                reaches from `aim`, and little more, for PhysX finds the direction of a hit within
                2.5 mrad. With 1 m a prism of 5 cm seemed 3.7 mm larger.

        PhysX's sessions report no geometry, so a large flat box is swept towards it from each side;
        where it hits nothing, it is nan.
        """
        centre, found = np.asarray((pose * aim).position), np.full(len(DIRECTIONS), np.nan)
        for k, direction in enumerate(DIRECTIONS @ pose.rotation().T):
            hits = self.physx.sweep(
                ovphysx_types.SceneQueryGeometryType.BOX,
                (-direction).tolist(),
                2 * span,
                ovphysx_types.SceneQueryMode.ALL,
                half_extent=(span, span, _FLAT),
                position=(centre + (span + _FLAT) * direction).tolist(),
                rotation=tuple(np.roll(turn_of_z(direction), -1).tolist()),
            )
            distances = [h["distance"] for h in self._of(collider, hits)]
            if distances:
                found[k] = span - min(distances)
        return found + DIRECTIONS @ np.asarray(aim.position)

    def height(self, collider: str) -> float:
        """Height of a plane above the origin, by a ray from above [m]."""
        hits = self._ray(collider, np.array([0.0, 0.0, REACH]), np.array([0.0, 0.0, -1.0]))
        return float(hits[0]["position"][2]) if hits else math.nan

    def _ray(
        self, collider: str, start: FloatArray, direction: FloatArray
    ) -> list[Mapping[str, Any]]:
        """Where a ray of twice `REACH` enters the collider."""
        mode = ovphysx_types.SceneQueryMode.ALL
        hits = self.physx.raycast(start.tolist(), direction.tolist(), 2 * REACH, mode)
        return self._of(collider, hits)

    def _of(self, collider: str, hits: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
        """The hits on one collider."""
        paths = self.physx.get_scene_query_paths_from_ids([hit["collision"] for hit in hits])
        return [hit for hit, path in zip(hits, paths, strict=True) if path == collider]

    def dof_joints(self) -> list[str]:
        """Prim paths of the articulation's joints in the order of the Jacobian's columns."""
        with self._reading("ARTICULATION", ["dofJointPath"]) as result:
            handles = np.array(result.groups[0].tensors[0].numpy(), dtype=np.uint64).ravel()
            return [result.dictionary.path_to_string(int(handle)) for handle in handles]


def _events(
    sensor: str, others: Any, told: Mapping[str, Any], dictionary: Any
) -> Iterator[tuple[tuple[str, str], list[tuple[FloatArray, FloatArray]]]]:
    """The pairs that a prim is in, with impulses on it and their places."""
    starts = {"Point": 0, "Anchor": 0}
    sides = np.ravel(told["contactEventSensorSide"])
    for k, handle in enumerate(np.ravel(others)):
        points: list[tuple[FloatArray, FloatArray]] = []
        for kind, start in starts.items():
            count = int(np.ravel(told[f"contactEvent{kind}Count"])[k])
            rows = slice(start, start + count)
            starts[kind] = start + count
            if count:  # impulses are those on the pair's first body
                impulses = told[f"contactEvent{kind}Impulse"][rows] * (1 - 2 * int(sides[k]))
                points += zip(impulses, told[f"contactEvent{kind}Position"][rows], strict=True)
        yield (sensor, dictionary.path_to_string(int(handle))), points


def _register_schemas() -> None:
    """Tell the USD library of PhysX's schemas, once in a process."""
    global _registered
    if not _registered:
        paths = [str(path) for path in schema_support.physx_schema_paths()]
        ovstage.population.register_usd_schemas(paths)
        _registered = True
