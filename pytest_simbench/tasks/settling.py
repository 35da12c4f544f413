"""A user's scene is left to itself: where do its free bodies come to rest, and how calmly?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from typing import Any, ClassVar

import numpy as np

from pytest_simbench.client.world import World
from pytest_simbench.description.links import link_poses
from pytest_simbench.description.urdf import PreparedRobot
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import Body, FloatArray, Pose, Scene, SceneError, Start
from pytest_simbench.scene.checks import check_number
from pytest_simbench.scene.overlap import rotations
from pytest_simbench.scene.penetration import penetration
from pytest_simbench.tasks.base import Count, Jitter, Outcome
from pytest_simbench.tasks.on_scene import FARTHEST, OnScene, places, started, ways
from pytest_simbench.tasks.resting import FORCE_JITTER, RESTLESS, SHORTEST, by_poses, calm, spread


@dataclass(frozen=True)
class RestsOn:
    """A premise: a body ends on another one.

    Attributes:
        body, support: names of two free bodies.
        within: largest distance of their origins in the plane [m].
        tilt: largest angle by which the body has turned away from the vertical [deg].
    """

    body: str
    support: str
    _: KW_ONLY
    within: float = 0.02
    tilt: float = 20.0

    def __str__(self) -> str:
        return (
            f"{self.body} rests on {self.support} (within {1000 * self.within:g} mm, tilt at most "
            f"{self.tilt:g} deg)"
        )


rests_on = RestsOn


@dataclass(frozen=True)
class Settling(OnScene):
    """Leave a scene to itself and see where its free bodies end.

    `--jitter` does not count here: the scene starts as it is written, or moved by `moved`.

    Attributes:
        world: the scene, of a file (`scene_file`) or made by hand. Repetitions go through its
            `starts`, if it has some.
        premises: what should be true at the end.
        seconds: simulated time, 1 at least [s].
        moved: each free body starts elsewhere by at most this in x and in y, by chance [m]; so does
            each slider in its range, and each hinge by so many rad: what is 1 m from its axis moves
            as far.
    """

    name: ClassVar[str] = "settling"
    draws: ClassVar[bool] = False
    references: ClassVar[Mapping[str, float]] = {"premises": 1.0}

    premises: Sequence[RestsOn] = ()
    seconds: float = 2.5
    moved: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "premises", tuple(self.premises))
        check_number(self.seconds, f"the time [s] of {self.name}", SHORTEST)
        if self.world.robot is None and not self.world.free_bodies:
            raise SceneError(
                f"scene {self.world.name!r} has nothing that moves, so nothing settles"
            )
        names = {body.name for body in self.world.free_bodies}
        for premise in self.premises:
            for name in (premise.body, premise.support):
                if name not in names:
                    raise SceneError(
                        f"the premise {str(premise)!r} names {name!r}, which is no free body of "
                        f"scene {self.world.name!r}; it has {', '.join(sorted(names))}"
                    )

    @property
    def different(self) -> int | None:
        return None if self.moved else super().different

    @property
    def metrics(self) -> tuple[Metric, ...]:
        told = "; ".join(map(str, self.premises))
        return (
            *(Metric("premises", "premises that hold", kind="share", of=len(self.premises),
                     doc=f"share of what should be true at the end: {told}")
              for _ in self.premises[:1]),
            FARTHEST,
            Metric("tilt", "largest tilt", unit="deg", better=None, least=0,
                   doc="of the free body that has turned most from the vertical since the start"),
            Metric("sunk", "deepest overlap", unit="mm", least=0, better="lower",
                   doc="of two bodies, or of a body and the ground, at the end"),
            Metric("restless", "restless", unit="mm/s", least=0, better="lower",
                   doc=f"root mean square speed of the bodies in the last {RESTLESS:g} s"),
            Metric("energy", "restless energy", unit="uJ", least=0, better="lower",
                   doc=f"mean kinetic energy of the bodies in the last {RESTLESS:g} s"),
            FORCE_JITTER,
        )  # fmt: skip

    def smoke(self) -> Settling:
        return replace(self, seconds=SHORTEST)

    def parameters(self) -> dict[str, Any]:
        return super().parameters() | {
            "task.premises": [str(premise) for premise in self.premises],
            "task.seconds": self.seconds,
            "task.moved": self.moved,
        }

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        scene, rng = super().scene(seed, jitter), np.random.default_rng(seed)
        if self.moved:
            for body in scene.free_bodies:
                x, y = rng.uniform(-self.moved, self.moved, 2)
                scene = scene.with_pose(body.name, body.pose.translated(float(x), float(y)))
            if scene.robot is not None:
                limits, positions = PreparedRobot(scene.robot).limits, []
                for joint in scene.robot.joints:
                    way = rng.uniform(-self.moved, self.moved) * (joint.name in self.movable)
                    ends = limits[joint.name]
                    positions.append(float(np.clip(joint.initial_position + way, *ends)))
                scene = scene.at_start(Start((), (), tuple(positions)))
        return scene

    @property
    def movable(self) -> frozenset[str]:
        """Joints that may start elsewhere: neither a loop nor a coupling holds them."""
        robot = self.world.robot
        if robot is None or robot.closures:
            return frozenset()
        pairs = (*robot.couplings, *robot.gripper.couplings)
        held = {name for pair in pairs for name in (pair.follower, pair.leader)}
        return frozenset(robot.joint_names) - held

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        scene = world.scene
        rest, forces = calm(world, self.seconds, "settle")
        prepared = None if scene.robot is None else PreparedRobot(scene.robot)
        before = started(scene) | _links(prepared, None)
        bodies = places(world)
        after = bodies | _links(prepared, world.joints[0])
        gone = ways(before, after)
        tilts = {name: tilted(before[name], pose) for name, pose in after.items()}
        failed = [str(p) for p in self.premises if not _holds(p, bodies, tilts)]
        ends = {body.name: body.moved_to(world.pose(body.name)) for body in scene.free_bodies}
        moving = by_poses(rest) if bodies else rest.bodies
        squares = np.sum(moving[:, :, 7:10] ** 2, axis=2)  # of speeds
        metrics: dict[str, float | None] = {
            "farthest": max(gone.values()),
            "tilt": max(tilts.values()),
            "sunk": 1000 * deepest(scene, ends),
            "restless": 1000 * float(np.sqrt(np.mean(squares))) if bodies else None,
            "energy": 1e6 * kinetic_energy(scene, moving) if bodies else None,
            "force_jitter": spread(scene, forces),
        }
        if self.premises:
            metrics["premises"] = 1 - len(failed) / len(self.premises)
        details = {
            "places": {name: pose.as_array().tolist() for name, pose in after.items()},
            "ways": {name: round(way, 4) for name, way in gone.items()},
            "tilts": {name: round(tilt, 4) for name, tilt in tilts.items()},
        }
        return Outcome(metrics, details, reasons=tuple(f"not: {text}" for text in failed))


def kinetic_energy(scene: Scene, states: FloatArray) -> float:
    """Mean over the time of that of all free bodies [J]; states as of `Motion.bodies`."""
    masses = np.array([body.mass for body in scene.free_bodies])
    moments = np.array([body.inertia() for body in scene.free_bodies])
    turns = rotations(states[..., 3:7].reshape(-1, 4)).reshape(*states.shape[:2], 3, 3)
    spins = np.einsum("tnij,tni->tnj", turns, states[..., 10:13])  # in the bodies' own axes
    moving = masses * np.sum(states[..., 7:10] ** 2, axis=2)
    return float(np.mean(np.sum(moving + np.sum(moments * spins**2, axis=2), axis=1)) / 2)


def _links(prepared: PreparedRobot | None, positions: FloatArray | None) -> dict[str, Pose]:
    """The moving links of the scene's robot, each at its centre of mass, at joint positions
    (n_joints,) [rad or m], None: the initial ones; none without a robot."""
    if prepared is None:
        return {}
    poses = link_poses(prepared, positions)
    return {
        link.name: poses[link.name] * Pose.at(*link.centre.tolist())
        for link in prepared.moving_links
    }


def tilted(before: Pose, after: Pose) -> float:
    """By what angle that direction of a body which was vertical has turned away from it [deg]."""
    upright = after.rotation() @ before.rotation().T
    return float(np.degrees(np.arccos(np.clip(upright[2, 2], -1.0, 1.0))))


def _holds(premise: RestsOn, ends: Mapping[str, Pose], tilts: Mapping[str, float]) -> bool:
    body, support = (np.array(ends[name].position) for name in (premise.body, premise.support))
    beside = float(np.hypot(*(body - support)[:2]))
    above = body[2] > support[2]
    return bool(beside <= premise.within and above and tilts[premise.body] <= premise.tilt)


def deepest(scene: Scene, ends: Mapping[str, Body]) -> float:
    """How deep any free body is in another body or in the ground [m], of pairs that collide; 0
    where none is."""
    bodies = [*ends.values(), *scene.fixed_bodies]
    down = np.array([[0.0, 0.0, -1.0]])
    depths = [0.0]
    for k, body in enumerate(ends.values()):
        own = f"body/{body.name}"
        if not scene.kept_apart("ground", own):
            depths.append(float(body.reach_placed(down)[0]))
        depths += [
            penetration(body, other)
            for other in bodies[k + 1 :]
            if not scene.kept_apart(own, f"body/{other.name}")
        ]
    return max(depths)
