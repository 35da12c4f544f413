"""Every request that a worker answers, asked in this process of an adapter that keeps a diary."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import execnet
import numpy as np
import pytest

from pytest_simbench import __version__
from pytest_simbench.scene import Box, Pose, Scene
from pytest_simbench.simulator import ParityError, StateError
from pytest_simbench.worker import stepping
from pytest_simbench.worker.server import Server, peak_rss_mb, reset_peak_rss, serve
from pytest_simbench.worker.wire import pack, unpack
from tests.worker.hosted import Hosted

CUBE = Box("cube", (0.05, 0.05, 0.05), Pose.at(0.5, 0.0, 0.5), mass=0.1)
SCENE = Scene("one", (CUBE,))
CONSTRUCT = {
    "adapter": "tests.worker.hosted:Hosted", "profile": "tuned", "changes": {}, "gui": False,
    "real_time": False,
}  # fmt: skip


class Asked:
    """A server and its answers."""

    def __init__(self) -> None:
        self.sent: list[Any] = []
        self.number = 0
        self.server = Server(self.sent.append)

    def __call__(self, op: str, **arguments: Any) -> Any:
        """The result of a request."""
        answer = self.answer(op, **arguments)
        assert set(answer) == {"ok"}, answer
        return unpack(answer["ok"])

    def answer(self, op: str, **arguments: Any) -> Any:
        self.number += 1
        self.server.answer({"op": op, "number": self.number, **pack(arguments)})
        answer = self.sent.pop()
        assert answer.pop("number") == self.number
        return answer

    def error(self, op: str, **arguments: Any) -> tuple[str, str]:
        """Type and message of what went wrong."""
        answer = self.answer(op, **arguments)
        assert execnet.loads(execnet.dumps(answer)) == answer
        assert set(answer) == {"error"}
        assert set(answer["error"]) == {"type", "message"}
        return answer["error"]["type"], answer["error"]["message"]

    def construct(self, **changes: Any) -> Any:
        return self("construct", **{**CONSTRUCT, **changes})

    def load(self, scene: Scene = SCENE, parity: bool = True) -> Any:
        return self("load", scene=scene.to_wire(), parity=parity)


@pytest.fixture
def ask(monkeypatch: pytest.MonkeyPatch) -> Iterator[Asked]:
    monkeypatch.setattr(Hosted, "built", {})
    for name in ("calls", "instances", "raises", "touching"):
        monkeypatch.setattr(Hosted, name, [])
    for variable in Hosted.info.environment:
        monkeypatch.delenv(variable, raising=False)
    yield Asked()
    for variable in Hosted.info.environment:
        os.environ.pop(variable, None)


@pytest.fixture
def loaded(ask: Asked) -> Asked:
    """One whose world is loaded."""
    ask.construct()
    ask.load()
    return ask


def test_hello(ask: Asked) -> None:
    version = "{}.{}.{}".format(*sys.version_info)
    assert ask("hello") == {"pid": os.getpid(), "version": __version__, "python": version}


def test_an_adapter_gets_its_settings(ask: Asked) -> None:
    gc.disable()  # as a worker does while it imports
    answer = ask.construct(changes={"stiffness": "3"})
    assert gc.isenabled()
    assert answer == {
        "settings": {"timestep": 0.004, "stiffness": 3.0},
        "versions": {"pytest-simbench": __version__},
        "untested": "not tested",
    }
    (made,) = Hosted.instances
    assert made.settings.to_wire() == answer["settings"]
    assert not made.gui
    assert ask.construct(profile="default")["settings"] == {"timestep": 0.002, "stiffness": 1.0}
    kind, message = ask.error("construct", **{**CONSTRUCT, "changes": {"speed": 1}})
    assert (kind, message[:31]) == ("SettingsError", "hosted has no setting 'speed'; ")
    kind, message = ask.error("construct", **{**CONSTRUCT, "profile": "fast"})
    assert message.startswith("hosted has no settings profile 'fast'; choose from default, ")


def test_a_window_shows_the_world_and_gets_no_variables(ask: Asked) -> None:
    os.environ["HOSTED_KEPT"] = "user's"
    ask.construct(gui=True)
    assert Hosted.instances[0].gui
    assert "HOSTED_SET" not in os.environ
    ask.load()
    assert Hosted.calls == [("load", "one"), "picture"]
    ask.construct()
    assert (os.environ["HOSTED_SET"], os.environ["HOSTED_KEPT"]) == ("ours", "user's")


def test_a_missing_engine_is_told_with_what_to_type(ask: Asked) -> None:
    assert ask.error("construct", **{**CONSTRUCT, "adapter": "tests.worker.hosted:Lame"}) == (
        "SimulatorError",
        "Lame does not import (No module named 'no_such_engine'); it is missing or half installed "
        f"in {sys.executable}: pip install lame",
    )


def test_a_worker_used_again_starts_anew(ask: Asked) -> None:
    ask.construct()
    assert Hosted.calls == []
    ask.load()
    ask("wait", duration=0.02, log_period=None)
    ask("save", name="a")
    ask.construct()
    assert Hosted.calls == [("load", "one"), "close"]
    assert len(Hosted.instances) == 2
    assert ask.error("wait", duration=0.1, log_period=None)[1] == "no scene was loaded yet"
    ask.load()
    assert ask.error("restore", name="a") == ("EngineError", "KeyError: 'a'")
    assert ask("state")["time"] == 0.0


@pytest.mark.parametrize(
    ("op", "arguments"),
    [
        ("state", {}),
        ("load", {"scene": SCENE.to_wire(), "parity": True}),
        ("compile", {"scene": SCENE.to_wire()}),
        ("read_back", {}),
        ("save", {"name": "a"}),
        ("contact_count", {}),
        ("render", {"width": 1, "height": 1}),
    ],
)
def test_nothing_goes_before_the_simulator(ask: Asked, op: str, arguments: dict[str, Any]) -> None:
    assert ask.error(op, **arguments) == ("SimulatorError", "no simulator was constructed yet")


def test_a_scene_that_an_engine_is_not_able_to(ask: Asked) -> None:
    ask.construct()
    scene = replace(SCENE, apart=((f"body/{CUBE.name}", "ground"),))
    found = ask.error("load", scene=scene.to_wire(), parity=True)
    assert found[0] == "NotSupportedError"
    assert not Hosted.calls


def test_a_loaded_world(ask: Asked) -> None:
    ask.construct()
    ask("compile", scene=SCENE.to_wire())
    answer = ask.load()
    assert set(answer) == {"time", "joints", "bodies", "excused", "timestep"}
    assert (answer["time"], answer["joints"].shape, answer["excused"]) == (0.0, (2, 0), [])
    assert answer["bodies"].tolist() == [[0.5, 0, 0.5, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0]]
    assert Hosted.calls == [("compile", "one"), ("load", "one")]
    assert ask.server.scene == SCENE
    state = ask("state")
    assert set(state) == {"time", "joints", "bodies"}
    assert state["bodies"].tolist() == answer["bodies"].tolist()


def test_what_was_built_is_held_against_the_scene(ask: Asked) -> None:
    ask.construct()
    Hosted.built.update({"body/cube/margin": None})
    assert ask.load()["excused"] == ["body/*/margin: has margins (not told by the engine)"]
    Hosted.built.update({"body/cube/margin": 0.002})
    ask.load()
    assert ask("misfit", names=["cube"]) == 0.002
    Hosted.built.update({"body/cube/mass": 0.2})
    assert ask.error("load", scene=SCENE.to_wire(), parity=True) == (
        "ParityError",
        "hosted built another world than the scene describes: body/cube/mass: scene 0.1, "
        "hosted 0.2",
    )
    assert ask.load(parity=False)["excused"] == []
    assert ask("misfit", names=["cube"]) == 0.0


def test_restitutions_that_differ_are_told(ask: Asked) -> None:
    ask.construct()
    answer = ask("load", scene=replace(SCENE, ground_restitution=0.5).to_wire(), parity=False)
    assert "restitution (0, 0.5)" in answer["excused"][0]


def test_a_deviation_of_other_shapes_excuses_nothing(ask: Asked) -> None:
    """The adapter declares one of the mass of cylinders, and the scene has none."""
    ask.construct()
    Hosted.built.update({"body/cube/mass": None})
    kind, message = ask.error("load", scene=SCENE.to_wire(), parity=True)
    assert (kind, "body/cube/mass" in message) == ("ParityError", True)


def test_a_world_that_starts_elsewhere_is_found(ask: Asked, monkeypatch: Any) -> None:
    ask.construct()
    monkeypatch.setattr(Hosted, "body_state", lambda self: np.zeros((1, 13)))
    assert ask.error("load", scene=SCENE.to_wire(), parity=False)[0] == "StateError"


def test_a_body_with_the_name_of_a_link(ask: Asked) -> None:
    from pytest_simbench.motion.panda import panda

    ask.construct()
    cube = Box("panda_hand", (0.05,) * 3, Pose.at(0.5, 0, 0.5), mass=0.1)
    scene = Scene("one", (cube,), panda())
    _, message = ask.error("load", scene=scene.to_wire(), parity=False)
    assert "a body is named 'panda_hand', as a link of the robot" in message
    assert Hosted.calls == []


def test_what_the_engine_says_while_it_remembers_another_scene(loaded: Asked) -> None:
    assert loaded("read_back")["body/cube/mass"] == 0.1
    other = SCENE.with_body(Box("cube", (0.05,) * 3, Pose.at(0.5, 0, 0.5), mass=0.3))
    assert loaded("read_back", remember=other.to_wire())["body/cube/mass"] == 0.3
    assert loaded("read_back")["body/cube/mass"] == 0.1


def test_waiting_and_following(loaded: Asked) -> None:
    answer = loaded("wait", duration=0.04, log_period=0.02)
    assert set(answer) == {"log", "time", "joints", "bodies"}
    assert answer["time"] == pytest.approx(0.04)
    assert np.allclose(answer["log"]["time"], [0.02, 0.04])
    assert answer["log"]["bodies"].shape == (2, 1, 13)
    rows = np.zeros((3, 0))
    loaded("watch", seed=1)
    moved = {"tick": 0.004, "position": rows, "velocity": rows, "effort": rows}
    answer = loaded("follow", **moved, log_period=None)
    assert set(answer) == {"log", "aside", "time", "joints", "bodies"}
    assert answer["time"] == pytest.approx(0.048)
    assert (answer["log"], answer["aside"] >= 0.0) == ({}, True)
    assert [call for call in Hosted.calls if call[0] == "command"] == [("command", [], [], [])] * 2


def test_a_log_that_is_none_is_found(loaded: Asked, monkeypatch: Any) -> None:
    monkeypatch.setattr(Hosted, "joint_state", lambda self: np.zeros((2, 1)))
    assert loaded.error("wait", duration=0.04, log_period=0.02) == (
        "StateError",
        "hosted: joint_state() must be an array of float64 (2, 0), not float64 (2, 1)",
    )


def test_saved_states_have_names(loaded: Asked) -> None:
    loaded("save", name="start")
    loaded("wait", duration=0.04, log_period=None)
    loaded("save", name="later")
    loaded("wait", duration=0.04, log_period=None)
    assert loaded("restore", name="start")["time"] == 0.0
    assert loaded("restore", name="later")["time"] == pytest.approx(0.04)


def test_contacts_and_pictures(loaded: Asked) -> None:
    assert loaded("contact_count") == 7
    assert loaded("render", width=4, height=3).shape == (3, 4, 3)


def test_a_film_is_of_whole_steps_and_of_the_size_asked_for(loaded: Asked) -> None:
    assert loaded("film", period=0.0085, width=4, height=3) == pytest.approx(0.008)
    loaded("wait", duration=0.016, log_period=None)
    frames = [sent["frame"] for sent in loaded.sent if "frame" in sent]
    assert [one["time"] for one in frames if one["seconds"] > 0.0] == pytest.approx([0.008, 0.016])
    assert [unpack(frame["picture"]).shape for frame in frames] == [(3, 4, 3)] * 2
    loaded.sent.clear()
    assert loaded("film", period=None, width=4, height=3) is None
    loaded("wait", duration=0.016, log_period=None)
    assert loaded.sent == []


def test_forces_of_a_pair_are_one_sum_on_the_first_by_name(loaded: Asked) -> None:
    one, two, three = np.arange(1.0, 7.0), np.full(6, 10.0), np.full(6, 0.5)
    Hosted.touching.extend([
        ("cube", "table", one), ("table", "cube", two), ("cube", "table", three), ("a", "b", one),
    ])  # fmt: skip
    (first, second, wrench), other = loaded("contact_forces")
    assert (first, second) == ("cube", "table")
    assert wrench == pytest.approx(one - two + three)
    assert other[:2] == ["a", "b"] or other[:2] == ("a", "b")
    assert other[2] == pytest.approx(one)


def test_statistics(ask: Asked) -> None:
    assert ask("stats")["stepping"] == {}
    ask.construct()
    ask.load()
    ask("wait", duration=0.04, log_period=None)
    stats = ask("stats")
    assert set(stats) == {"stepping", "peak_rss_mb"}
    assert stats["stepping"]["steps"] == 10
    assert set(stats["stepping"]) == {
        "steps", "simulated", "wall", "waited", "cpu",
        "control_runs", "control_wall", "control_waited", "control_cpu",
    }  # fmt: skip
    assert 10 < stats["peak_rss_mb"] < 100_000


@pytest.mark.parametrize("real_time", [True, False])
def test_it_waits_for_the_wall_clock_where_asked(ask: Asked, real_time: bool) -> None:
    ask.construct(real_time=real_time)
    ask.load()
    assert ask.server.stepper.real_time is real_time


def test_signs_of_life(loaded: Asked, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stepping, "HEARTBEAT_PERIOD", -1.0)
    loaded("wait", duration=0.2, log_period=None)
    assert loaded.sent
    assert all(set(sign) == {"alive"} and type(sign["alive"]) is float for sign in loaded.sent)
    assert [sign["alive"] for sign in loaded.sent] == pytest.approx([0.1, 0.2])


def test_closing(ask: Asked) -> None:
    assert ask("close") is None  # nothing to close
    ask.construct()
    assert ask("close") is None
    assert Hosted.calls == ["close"]


class Adapters(StateError):
    """An adapter's own kind of error."""


class Mute(Exception):
    def __str__(self) -> str:
        raise RuntimeError("no text")

    __repr__ = __str__


class MuteParity(Mute, ParityError):
    """One of ours that has no text either."""


class Exiting(Exception):
    def __str__(self) -> str:
        raise SystemExit(9)


class Letters(str):
    """A text that is no text to execnet."""


class Spelt(Exception):
    def __str__(self) -> str:
        return Letters("mine")


class Rude(BaseException):
    """An exception that no `except Exception` sees."""


@pytest.mark.parametrize(
    ("error", "kind", "message"),
    [
        (ParityError("so"), "ParityError", "so"),
        (Adapters("so"), "StateError", "so"),
        (MemoryError("so"), "MemoryError", "so"),
        (MemoryError(), "MemoryError", "out of memory"),
        (SystemExit(), "SystemExit", "the adapter called sys.exit(0)"),
        (SystemExit(3), "SystemExit", "the adapter called sys.exit(3)"),
        (SystemExit("no"), "SystemExit", "the adapter called sys.exit('no'), status 1"),
        (ValueError("so"), "EngineError", "ValueError: so"),
        (Rude("so"), "EngineError", "Rude: so"),
        (Mute(), "EngineError", "Mute: (its message cannot be read: RuntimeError)"),
        (Exiting(), "EngineError", "Exiting: (its message cannot be read: SystemExit)"),
        (Spelt(), "EngineError", "Spelt: mine"),
        (MuteParity(), "ParityError", "(its message cannot be read: RuntimeError)"),
        (
            SystemExit(Mute()),
            "SystemExit",
            "the adapter called sys.exit('(its message cannot be read: RuntimeError)'), status 1",
        ),
        (ValueError(b"b", {1: 2}, None), "EngineError", "ValueError: (b'b', {1: 2}, None)"),
    ],
)
def test_every_error_is_an_answer(
    loaded: Asked, error: BaseException, kind: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Hosted.raises.append(error)
    assert loaded.error("wait", duration=0.1, log_period=None) == (kind, message)
    log = capsys.readouterr().err
    assert log.startswith("Traceback (most recent call last):")
    assert type(error).__name__ in log
    Hosted.raises.clear()
    assert loaded("wait", duration=0.1, log_period=None)["time"] == pytest.approx(0.1)


def test_an_error_is_an_answer_though_the_log_cannot_be_written(
    loaded: Asked, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Full:
        def write(self, text: str) -> int:
            raise OSError(28, "No space left on device")

        flush = None

    Hosted.raises.append(ValueError("so"))
    monkeypatch.setattr(sys, "stderr", Full())
    assert loaded.error("wait", duration=0.1, log_period=None) == ("EngineError", "ValueError: so")


def test_the_log_holds_a_long_traceback_cut(
    loaded: Asked, capsys: pytest.CaptureFixture[str]
) -> None:
    Hosted.raises.append(ValueError("x" * 200_000))
    loaded.error("wait", duration=0.1, log_period=None)
    assert 100_000 < len(capsys.readouterr().err) < 100_100


def test_an_unknown_request_is_an_answer_too(ask: Asked) -> None:
    kind, message = ask.error("dance")
    assert (kind, "do_dance" in message) == ("EngineError", True)


def test_it_serves_until_it_is_told_to_close() -> None:
    requests: list[dict[str, Any]] = [
        {"op": op, "number": number} for number, op in enumerate(("hello", "close", "hello"))
    ]
    sent: list[Any] = []
    serve(lambda: requests.pop(0), sent.append)
    assert [(answer["number"], "ok" in answer) for answer in sent] == [(0, True), (1, True)]
    assert sent[1]["ok"] is None
    assert len(requests) == 1


CODE = """
from pytest_simbench.worker.server import peak_rss_mb, reset_peak_rss

def kilobytes(key):
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith(key))

block = bytearray(b"x") * 100_000_000
peak, before = peak_rss_mb(), kilobytes("VmHWM")
del block
reset_peak_rss()
print(peak, before, peak_rss_mb(), kilobytes("VmRSS"))
"""


def test_the_peak_is_the_kernel_s_and_starts_anew() -> None:
    found = subprocess.run(
        [sys.executable, "-c", CODE], capture_output=True, text=True, check=True
    ).stdout.split()
    peak, kilobytes, after, now = map(float, found)
    assert peak == pytest.approx(kilobytes * 1024 / 1e6, rel=3e-4)  # not MiB: 4.9 % less
    assert peak > 100
    assert after < peak - 90
    assert after == pytest.approx(now * 1024 / 1e6, rel=0.05)


def test_where_the_kernel_tells_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*args: object, **options: object) -> None:
        raise PermissionError("no /proc here")

    monkeypatch.setattr("builtins.open", refused)
    assert peak_rss_mb() is None
    reset_peak_rss()
