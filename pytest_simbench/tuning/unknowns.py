"""Numbers of a scene that a log may tell, `KIND:NAME`, and the scene with other values of them."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pytest_simbench.description.robot_files import content_of, description_xml, keep
from pytest_simbench.description.urdf import INERTIA, PreparedRobot
from pytest_simbench.scene import Robot, Scene, SceneError, Start
from pytest_simbench.scene.pose import vector3
from pytest_simbench.scene.robot import FREE
from pytest_simbench.tasks import Log
from pytest_simbench.tasks.base import distance
from pytest_simbench.tasks.on_scene import started
from pytest_simbench.tuning.target import TuningError

GROUND = "ground"

OF_BODIES = ("mass", "friction", "linear_damping", "angular_damping")
"""Attributes of bodies. Of links there is a mass, and the friction of all of them."""

OF_JOINTS = {
    kind: kind.removeprefix("joint_")
    for kind in ("stiffness", "damping", "passive_damping", "joint_friction", "spring", "armature")
}
"""Attributes of joints; the first two are of their drives."""

FACTOR = 10.0
"""From the scene's value to either end of a range that nobody names."""

START = "start"
"""Kind of what is sought beside the unknowns: where a joint begins [rad or m]."""

NEAR = 0.005
"""A body begins where the scene has it, if the log has it within this [m]; else where the log has
it, noise and all."""


@dataclass(frozen=True)
class Unknown:
    """A number of a scene that is sought.

    Attributes:
        name: `KIND:NAME`.
        value: the scene's.
        low, high: between which it is sought, on a logarithmic scale.
    """

    name: str
    value: float
    low: float
    high: float


def known(scene: Scene) -> dict[str, float]:
    """What may be sought of a scene, and its values there."""
    found = {f"friction:{GROUND}": scene.ground_friction}
    for body in scene.bodies:
        own = OF_BODIES if body.mass else ("friction",)
        found |= {f"{kind}:{body.name}": getattr(body, kind) for kind in own}
    if scene.robot is not None:
        found[f"friction:{scene.robot.name}"] = scene.robot.friction
        links = _inertials(description_xml(scene.robot))
        masses = {name: float(one.find("mass").get("value")) for name, one in links}  # type: ignore
        found |= {f"mass:{name}": mass for name, mass in masses.items() if mass}
        for joint in scene.robot.joints:
            found |= {f"{k}:{joint.name}": getattr(joint, of) for k, of in OF_JOINTS.items()}
    return found


def unknowns(texts: Sequence[str], scene: Scene, log: Log) -> list[Unknown]:
    """Of `KIND:NAME` or `KIND:NAME=LOW..HIGH`, for a log of that scene.

    Raises:
        TuningError: one that cannot be sought; one sentence.
    """
    values, found = known(scene), {}
    told = ", ".join(values)
    choices = f"choose from {told if len(told) < 1000 else told[:1000] + ' ...'}"
    if not texts:
        raise TuningError(f"name what is unknown: --unknown NAME; {choices}")
    for text in texts:
        name, given, ends = (part.strip() for part in text.partition("="))
        if name not in values:
            raise TuningError(f"scene {scene.name!r} has no {name[:60]!r}; {choices}")
        if name in found:
            raise TuningError(f"{name} is given twice; give it once")
        value = values[name]
        if given:
            low, high = _range(ends, text)
        elif value > FREE:
            low, high = value / FACTOR, value * FACTOR
        else:
            raise TuningError(f"{name} is {value:g} in the scene: give a range, {name}=LOW..HIGH")
        _check_told(name, scene, log)
        try:
            for end in (low, high):
                changed(scene, {name: end})
        except SceneError as error:
            raise TuningError(f"{text[:80]!r}: {error}") from None
        found[name] = Unknown(name, value, low, high)
    return list(found.values())


def _range(ends: str, text: str) -> tuple[float, float]:
    try:
        low, high = map(float, ends.split(".."))
    except ValueError:
        low, high = 0.0, 0.0
    if not 0 < low < high < float("inf"):
        raise TuningError(f"{text[:80]!r}: give a range as NAME=LOW..HIGH, with 0 < LOW < HIGH")
    return low, high


def _check_told(name: str, scene: Scene, log: Log) -> None:
    """Complain of a driven joint whose commands nobody knows: it would follow what was measured."""
    kind, _, of = name.partition(":")
    if kind not in OF_JOINTS or scene.robot is None or of in log.told:
        return
    drive = scene.robot.joints[scene.robot.joint_names.index(of)]
    if kind in ("stiffness", "damping") or drive.stiffness > FREE or drive.damping:
        raise TuningError(
            f"{name}: the log lacks the column {of}/command, so it does not say what the drive was "
            "told"
        )


def changed(scene: Scene, values: Mapping[str, float]) -> Scene:
    """The scene with other values of what is sought. With a mass change the inertia, what bears a
    share of the weight, and the rates of damping, which a file says as a force and a torque."""
    for label, value in sorted(values.items(), reverse=True):  # a mass before rates of damping
        kind, _, name = label.partition(":")
        scene = _changed(scene, kind, name, value)
    return scene


def _changed(scene: Scene, kind: str, name: str, value: float) -> Scene:
    if kind == "friction" and name == GROUND:
        return replace(scene, ground_friction=value)
    if kind in OF_BODIES and name in {body.name for body in scene.bodies}:
        body = scene.body(name)
        if kind == "friction":
            return scene.with_body(body.with_friction(value))
        change: dict[str, Any] = {kind: value}
        if kind == "mass":
            factor = value / body.mass
            change |= {k: getattr(body, k) / factor for k in OF_BODIES if "damping" in k}
            borne = (replace(w, force=vector3(factor * np.array(w.force))) for w in body.wrenches)
            change["wrenches"] = tuple(borne)
            if body.moments is not None:
                change["moments"] = tuple(factor * moment for moment in body.moments)
        return scene.with_body(body.changed(**change))
    robot = scene.arm
    if kind in OF_BODIES:
        whole = replace(robot, friction=value) if kind == "friction" else _heavy(robot, name, value)
        return replace(scene, robot=whole)
    of_joint: dict[str, Any] = {OF_JOINTS.get(kind, kind): value}
    if kind == START:
        ends = PreparedRobot(robot).limits[name]
        of_joint = {"initial_position": float(np.clip(value, *ends))}
    return replace(scene, robot=robot.with_joints(name, **of_joint))


def _heavy(robot: Robot, link: str, mass: float) -> Robot:
    """With another mass of a link; its inertia changes as much."""
    kept = content_of(robot)
    xml = ET.fromstring(kept["urdf"])
    inertial = dict(_inertials(xml))[link]
    factor = mass / float(inertial.find("mass").get("value"))  # type: ignore
    for element in inertial:
        for key in {"value", *INERTIA} & {*element.keys()}:
            element.set(key, repr(factor * float(element.get(key, 0))))
    return replace(robot, urdf=str(keep(xml, kept["meshes"])), packages={})


def _inertials(xml: ET.Element) -> Iterator[tuple[str, ET.Element]]:
    """Of links, by name."""
    for link in xml.iter("link"):
        inertial = link.find("inertial")
        if inertial is not None and inertial.find("mass") is not None:
            yield link.get("name", ""), inertial


def begun(scene: Scene, log: Log) -> Scene:
    """The scene as it is where the log begins."""
    own, start = started(scene), log.start
    logged = zip(start.bodies, start.poses, strict=True)
    moved = {name: pose for name, pose in logged if distance(own[name], pose) > NEAR}
    there = Start(tuple(moved), tuple(moved.values()), start.positions)
    return replace(scene.at_start(there), starts=())


def starts(scene: Scene, log: Log) -> dict[str, float]:
    """Where joints begin is measured no better than the rest, so it is sought too, unless others
    move with them. By name, as unknowns have it."""
    if scene.robot is None or scene.robot.closures:
        return {}
    coupled = {name for c in scene.robot.couplings for name in (c.follower, c.leader)}
    positions = {joint.name: joint.initial_position for joint in scene.robot.joints}
    return {f"{START}:{name}": positions[name] for name in log.joints if name not in coupled}
