"""What two engines are given as text, word for word, with each profile: scenes of laws and tasks
with every kind of shape, joint, coupling and closure; each line once. Neither engine is needed."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pytest_simbench.sims.gazebo.adapter import Gazebo
from pytest_simbench.sims.gazebo.sdf import Physics, is_lone, world_text
from pytest_simbench.sims.ovphysx.adapter import OvPhysX, _attributes
from pytest_simbench.sims.ovphysx.stage import Stage

from pytest_simbench.laws import LAWS
from pytest_simbench.scene import Compound, Scene
from pytest_simbench.simulator import PreparedRobot
from pytest_simbench.tasks import Carrying, Nesting, Opening, Throwing
from pytest_simbench.tasks.base import Jitter
from tests.approval import assert_approved

ASKED = {
    "spin", "damped_fall", "oblique_gravity", "free_cylinder", "double_pendulum", "four_bar_swing",
    "swinging_slider", "spring_damper", "belt", "bounce_height", "rimless_wheel", "push_turns",
}  # fmt: skip
NUMBER = re.compile(r"-?\d+(\.\d+)?(e[-+]?\d+)?")
MANY = re.compile(r"(?:-?[\d.][\d.e+-]*[\s,()\[\]]+){24,}")
"""The corners of a hull, for instance."""

TRIANGLES = re.compile(r"(faceVertexIndices = \[)([^]]*)\]")
FOLDER = re.compile(r"(?<=[>\"@])/[\w./+-]*/")


def scenes() -> Iterator[Scene]:
    for law in LAWS:
        if law.name in ASKED:
            yield law.build()
    for task in (Throwing().smoke(), Carrying("prism"), Nesting().smoke(), Opening()):
        yield task.scene(1001, Jitter())


def short(text: str) -> str:
    """Numbers with six digits, and of very many a digest."""
    rounded = NUMBER.sub(lambda m: f"{round(float(m[0]), 7) + 0.0:.6g}", text)
    return MANY.sub(lambda m: f"<{hashlib.sha256(m[0].encode()).hexdigest()[:10]}> ", rounded)


def sdf(scene: Scene, prepared: PreparedRobot | None, profile: str, folder: Path) -> str:
    physics = Physics(Gazebo.profiles[profile], is_lone(scene))
    return world_text(scene, prepared, physics, scene.name, folder, drawn=profile == "tuned")


def usd(scene: Scene, prepared: PreparedRobot | None, profile: str, folder: Path) -> str:
    """Where triangles of a hull begin is a matter of last digits, which processors differ in."""
    told = Stage(scene, prepared, _attributes(OvPhysX.profiles[profile])).text()
    return TRIANGLES.sub(lambda found: f"{found[1]}{found[2].count(',') + 1} numbers]", told)


@pytest.mark.parametrize("written", [sdf, usd], ids=lambda made: made.__name__)
def test_worlds(written: Any, tmp_path: Path) -> None:
    lines = []
    profiles = {sdf: Gazebo.profiles, usd: OvPhysX.profiles}[written]
    for scene in scenes():
        prepared = scene.robot and PreparedRobot(scene.robot)
        if written is sdf and any(isinstance(body, Compound) for body in scene.bodies):
            continue
        for profile in profiles:
            text = FOLDER.sub("", short(written(scene, prepared, profile, tmp_path)))
            lines += [f"=== {scene.name} {profile}", *text.splitlines()]
    assert_approved(f"written-{written.__name__}", "\n".join(dict.fromkeys(lines)))
