"""What an engine must not do while it is stepped, in MuJoCo and PyBullet, and what tells it."""

from __future__ import annotations

import re
from typing import Any

import pytest

from pytest_simbench.robot.panda import panda
from pytest_simbench.scene import Scene
from pytest_simbench.worker.server import Server
from pytest_simbench.worker.wire import pack
from tests.conftest import ADAPTERS
from tests.worker.cheats import CHEATS, CUBE, LATER, UNTIL

SCENE = Scene("flight", (CUBE,), panda())

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
    (
        "snap",
        "loaded",
    ): r"starts a world at t = 0 s with speeds that differ from the scene's by up to 1",
    (
        "snap",
        "later",
    ): r"let 'cube' jump: it moved by 0\.98\d m in the 0\.09\d* s before t = 0\.300 s",
}
"""By cheat and time: the one sentence."""


def told(adapter: str, *, seed: int = 1, log_period: float | None = None) -> str:
    """What ends a repetition in which the cube flies for 0.5 s and lies for 0.7 s."""
    answers: list[Any] = []
    server = Server(answers.append)
    try:
        for op, arguments in (
            ("construct", {"adapter": adapter, "profile": "tuned", "changes": {}, "gui": False,
                           "real_time": False}),
            ("load", {"scene": SCENE.to_wire(), "parity": True}),
            ("watch", {"seed": seed}),
            ("wait", {"duration": 1.2, "log_period": log_period}),
            ("read_again", {}),
        ):  # fmt: skip
            server.answer({"op": op, **pack(arguments)})
            if "error" in answers[-1]:
                return str(answers[-1]["error"]["message"])
        return ""
    finally:
        server.do_close()


@pytest.mark.parametrize(("cheat", "when"), TOLD)
@pytest.mark.parametrize("engine", CHEATS)
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
@pytest.mark.parametrize("log_period", [None, 0.0])
def test_who_does_not_cheat_is_not_told(engine: str, log_period: float | None) -> None:
    assert told(ADAPTERS[engine], log_period=log_period) == ""
