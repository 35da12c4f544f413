"""What an engine must not do while it is stepped, in MuJoCo and PyBullet, and what tells it."""

from __future__ import annotations

import re
import time
from contextlib import nullcontext
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pytest_simbench.laws.mechanisms import Part, mechanism
from pytest_simbench.motion.panda import panda
from pytest_simbench.parity.quantities import expected_quantities
from pytest_simbench.scene import Box, Pose, Scene, Sphere, Wrench
from pytest_simbench.simulator import DivergedError, ParityError
from pytest_simbench.worker.server import Server
from pytest_simbench.worker.watching import Obstacles, Watch
from pytest_simbench.worker.wire import pack
from tests.conftest import ADAPTERS
from tests.worker.cheats import CUBE, LATER, UNTIL
from tests.worker.hosted import Toy

Operation = tuple[str, dict[str, Any]]
"""A request to a worker, and its arguments."""

SCENE = Scene("flight", (CUBE,), panda())

PUSH = Wrench(force=(0.5, 0.0, 0.5), start=0.1, end=0.4)

BUILT = r"\w+ built another world than the scene describes: "
FALLS = r"accelerated 'cube' by \(.*, -4\.9\) m/s\^2 at t = {} s, where it flew free and gravity is"
CHANGED = r"changed {} while it ran: {} when it was loaded, {} at t = "
FINGERS = "link/panda_leftfinger/friction"

TOLD = {
    ("friction", "loaded"): rf"{BUILT}{FINGERS}: scene 1\., \w+ 20\.",
    ("friction", "later"): CHANGED.format(FINGERS, r"1\.", r"20\."),
    ("masses", "loaded"): rf"{BUILT}body/cube/mass: scene 0\.1, \w+ 1\.",
    ("masses", "later"): CHANGED.format("body/cube/mass", r"0\.1", r"1\."),
    ("gravity", "loaded"): rf"{BUILT}gravity: scene \[.* -9\.80665\], \w+ \[.* -4\.903325\]",
    ("gravity", "later"): FALLS.format(r"0\.3\d+"),
    ("lift", "loaded"): FALLS.format(r"0\.1\d+"),
    ("lift", "later"): FALLS.format(r"0\.3\d+"),
    ("time", "loaded"): rf"{BUILT}timestep: scene 0\.00\d+, \w+ 0\.00\d+",
    ("time", "later"): FALLS.format(r"0\.3\d+"),
    ("snap", "loaded"): r"starts a world at t = 0 s with speeds .* the scene's by up to 1",
    ("snap", "later"): r"'cube' jump: it moved by 0\.9[78]\d* m in the 0\.09\d* s .* = 0\.300",
}
"""By cheat and time: the one sentence."""


def wait(duration: float, log_period: float | None = None) -> Operation:
    return "wait", {"duration": duration, "log_period": log_period}


def told(
    adapter: str, *operations: Operation, scene: Scene = SCENE, seed: int = 1, watched: bool = True
) -> str:
    """What ends a repetition; by default one in which the cube flies for 0.5 s, then lies."""
    answers: list[Any] = []
    server = Server(answers.append)
    construct = {"profile": "tuned", "changes": {}, "gui": False, "real_time": False}
    try:
        for op, arguments in (
            ("construct", {"adapter": adapter, **construct}),
            ("load", {"scene": scene.to_wire(), "parity": True}),
            *([("watch", {"seed": seed})] if watched else []),
            *(operations or [wait(1.2)]),
            ("read_again", {}),
        ):
            server.answer({"op": op, "number": len(answers) + 1, **pack(arguments)})
            if "error" in answers[-1]:
                return str(answers[-1]["error"]["message"])
        return ""
    finally:
        server.do_close()


@pytest.mark.parametrize(("cheat", "when"), TOLD)
@pytest.mark.parametrize("engine", ["MuJoCo", "PyBullet"])
def test_a_cheat_is_told_in_one_sentence(engine: str, cheat: str, when: str) -> None:
    message = told(f"tests.worker.cheats:{engine}_{cheat}_{when}")
    assert re.search(TOLD[cheat, when], message), message
    assert "\n" not in message


@pytest.mark.parametrize("seed", range(3))
def test_what_is_undone_again_is_told_by_a_step_drawn_meanwhile(seed: int) -> None:
    """It lasts for 0.65 s of the first one, in which a step is drawn; at the end it is over."""
    message = told("tests.worker.cheats:MuJoCo_friction_a_while", seed=seed + 1)
    at = float(message.rpartition("t = ")[2].partition(" ")[0])
    assert LATER < at < UNTIL


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
@pytest.mark.parametrize(
    ("scene", "operations"),
    [
        (SCENE, [wait(1.2)]),
        (SCENE, [wait(1.2, 0.0)]),
        (SCENE, [wait(0.1), ("save", {"name": "a"}), wait(0.8), ("restore", {"name": "a"})]),
        (Scene("nothing"), [wait(1.2)]),
        (Scene("arm", robot=panda()), [wait(1.2)]),
        (Scene("air", (replace(CUBE, linear_damping=2.0),)), [wait(0.4)]),
        (Scene("wind", (replace(CUBE, wrenches=(PUSH,)),)), [wait(0.5)]),
    ],
    ids=["unlogged", "logged", "restored", "nothing", "arm", "air", "pushed"],
)  # fmt: skip
def test_who_does_not_cheat_is_not_told(
    engine: str, scene: Scene, operations: list[Operation]
) -> None:
    assert told(ADAPTERS[engine], *operations, scene=scene) == ""


def test_a_jump_is_told_by_each_step_of_a_log_and_a_small_one_by_no_less() -> None:
    """5 mm sideways: in a log of every step, and not in 0.1 s."""
    adapter = "tests.worker.cheats:MuJoCo_nudge_later"
    pattern = r"let 'cube' jump: it moved by 0\.00\d+ m in the 0\.001 s before t = 0\.25"
    assert re.search(pattern, told(adapter, wait(1.2, 0.0)))
    assert told(adapter) == ""


def test_joints_of_a_users_file_may_swing_there_and_back_between_two_looks() -> None:
    """A short pendulum that hangs free does so in a fifth of a second; a driven arm does not."""
    bob = Part("bob", (0, 1, 0), centre=(0.007, 0, 0), inertia=(1e-6,) * 3)
    scene = Scene("limp", robot=mechanism("bob", bob))
    assert "let 'bob' jump" in told(ADAPTERS["mujoco"], scene=scene)
    assert told(ADAPTERS["mujoco"], scene=replace(scene, file="bob.xml")) == ""


def test_only_who_is_watched_is_told() -> None:
    """The kit plants faults of its own, and finds them by its laws."""
    assert told("tests.worker.cheats:MuJoCo_lift_later", watched=False) == ""


def test_how_long_it_read_is_told_once() -> None:
    watch, began = Watch(Toy(), Scene("toy"), {}, {}, 1), time.perf_counter()
    assert watch.spent() == 0.0
    watch.read()
    assert 0.0 < watch.spent() < time.perf_counter() - began
    assert watch.spent() == 0.0


def test_a_joint_jumps_from_0_to_rest() -> None:
    toy = Toy()
    toy.bodies, toy.joints = np.zeros((0, 13)), np.zeros((2, 9))
    scene = Scene("arm", robot=panda())
    watch = Watch(toy, scene, expected_quantities(scene, toy.settings), {}, 1)
    toy.steps = 1
    with pytest.raises(ParityError, match="let 'panda_joint1' jump: it moved by 1 rad"):
        watch.look(1, np.array([[1.0, *[0.0] * 8], [0.0] * 9]), toy.bodies)


def test_steps_are_drawn_in_spans_that_grow() -> None:
    """In the first second, then up to 4, 16 and 64 s; other ones with another seed."""
    drawn = []
    for seed in range(20):
        toy = Toy()
        toy.bodies = np.zeros((0, 13))
        watch = Watch(toy, Scene("toy"), {}, {}, seed)
        steps = []
        while toy.steps < 64 / 0.002:
            steps.append(watch.due)
            toy.steps = watch.due
            watch.look(watch.due, toy.joint_state(), toy.bodies)
        drawn.append(steps)
        spans = [(0, 500), (500, 2000), (2000, 8000), (8000, 32000)]
        assert all(a < step <= b for step, (a, b) in zip(steps, spans, strict=False))
        assert len(steps) >= 4
    assert len({steps[0] for steps in drawn}) > 10


@pytest.mark.parametrize(("speed", "told"), [(-3.0, ""), (0.0, "deep in the ground")])
def test_an_impact_is_deep_for_a_moment_and_no_divergence(speed: float, told: str) -> None:
    """A small ball falls 0.3 m in 0.1 s, into the ground. What its speed explains is none."""
    ball = Sphere("ball", 0.008, Pose.at(0.0, 0.0, 0.3), 0.005)
    toy, scene = Toy(), Scene("fall", (ball,))
    toy.bodies = np.array([[0.0, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0, *[0.0] * 6]])
    watch = Watch(toy, scene, expected_quantities(scene, toy.settings), {}, 1)
    toy.steps, fallen = 50, toy.bodies.copy()
    fallen[0, [2, 9]] = 0.001, speed
    with pytest.raises(DivergedError, match=told) if told else nullcontext():
        watch.look(50, toy.joint_state(), fallen)


def test_a_turning_body_and_a_joint_go_as_far_as_their_speeds_explain() -> None:
    """By the body's farthest point, 0.65 m from its middle, and by a surge."""
    brick = Box("brick", (0.3, 0.4, 1.2), Pose.at(0.0, 0.0, 2.0), 1.0)
    toy, scene = Toy(), Scene("turning", (brick,), panda())
    toy.joints = np.zeros((2, 9))
    watch = Watch(toy, scene, expected_quantities(scene, toy.settings), {}, 1)
    bodies, joints = np.zeros((3, 1, 13)), np.zeros((3, 2, 9))
    bodies[0, 0, [7, 11]], joints[2, 1, 1] = (1.0, 2.0), -0.5
    log = {"time": np.array([0.1, 0.2, 0.4]), "joints": joints, "bodies": bodies}
    for place, angle, told in ((0.279, 1.09, ""), (0.281, 0.0, "'brick'"), (0.0, 1.11, "_joint2'")):
        bodies[1:, 0, 0], joints[2, 0, 1] = place, angle
        with pytest.raises(ParityError, match=told) if told else nullcontext():
            watch.check_log(log)


@pytest.mark.parametrize("near", ["ground", "wall"])
def test_what_flies_is_accelerated_by_gravity_alone(near: str) -> None:
    """To a twentieth, beside its damping; clear of all by its radius, 1 cm, and twice its way."""
    for off, away, damping, told in (
        (0.48, 1.0, 0.0, False), (0.5, 1.0, 0.0, True), (-0.5, 1.0, 0.0, True),
        (0.6, 0.055, 0.0, False), (0.6, 0.056, 0.0, True),
        (1.16, 1.0, 0.1, False), (1.19, 1.0, 0.1, True),
    ):  # fmt: skip
        x, z = (9.0, away) if near == "ground" else (away, 3.0)
        ball = Sphere("ball", 0.01, Pose.at(-x, 0.0, z), 0.1, linear_damping=damping)
        wall = Box("wall", (0.2, 9.0, 9.0), Pose.at(0.1, 0.0, 0.0))
        quick = replace(ball, name="quick", pose=Pose.at(-5.0, 6.0, 6.0))  # is allowed more
        toy, scene = Toy(), Scene("flight", (ball, quick, wall), room=(10.0, 10.0, 10.0))
        toy.bodies = np.array([[*ball.pose.as_array(), -1.0, 0.0, 1.0, *[0.0] * 3],
                               [*quick.pose.as_array(), 0.0, 0.0, 30.0, *[0.0] * 3]])  # fmt: skip
        watch = Watch(toy, scene, expected_quantities(scene, toy.settings), {}, 1)
        for toy.steps, falls in ((10, False), (12, False), (15, True)):
            toy.bodies[:, 9] += falls * 0.01 * (np.array([off, 0.0]) - 9.80665)
            with pytest.raises(ParityError, match="'ball'") if told and falls else nullcontext():
                watch.look(toy.steps, toy.joints, toy.bodies)


def test_how_far_it_is_to_all_that_a_ball_can_touch() -> None:
    """The faces of a wall, another ball's box, and those of the arm's links; not itself."""
    balls = [Sphere(name, 0.1, Pose.at(x, 3.0, 1.0), 0.1) for name, x in (("a", 0.0), ("b", 1.0))]
    scene = Scene("s", (*balls, Box("wall", (9.0, 0.2, 9.0), Pose.at(0.0, 3.5, 0.0))))
    bodies = np.array([[*ball.pose.as_array(), *[0.0] * 6] for ball in balls])
    for robot, y, apart in ((None, 3.0, 0.4), (None, 1.0, 0.9), (panda(), -0.3, None)):
        bodies[:, 1:3] = (y, 1.0) if robot is None else (y, 0.1)
        of = replace(scene, robot=robot)
        boxes = Obstacles(of, expected_quantities(of, Toy().settings))
        found, _ = boxes.distances(bodies, np.zeros(9), [0, 1])
        assert found == pytest.approx(apart) if apart else 0.1 < found < 0.25  # the arm's base
