"""Episodes: one at a time, and safe after whatever ends them. Their files may come from anybody."""

from __future__ import annotations

import json
import os
import signal
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.errors import UnsatisfiedAssumption

from pytest_simbench.cli.main import main
from pytest_simbench.client.errors import WorkerExited
from pytest_simbench.client.tape import ARRAYS, Operation
from pytest_simbench.experiment import example
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.example import (
    LARGEST,
    Example,
    ExampleError,
    read_example,
    replay_command,
    write_example,
)
from pytest_simbench.experiment.handle import SimulatorHandle
from pytest_simbench.motion.panda import panda
from pytest_simbench.motion.registry import find
from pytest_simbench.scene import Pose, Robot, Scene
from pytest_simbench.tasks.base import cube
from tests.approval import assert_approved_line
from tests.hostile import assert_harmless_terminal

WHITE = (1.0, 1.0, 1.0, 1.0)
SCENE = Scene("s", (cube("a", Pose.at(0.0, 0.0, 0.2), WHITE),))


def test_one_worker_for_all_episodes(handle: SimulatorHandle) -> None:
    pids = set()
    for _ in range(3):
        with handle.episode(SCENE) as world:
            assert world.time == 0
            world.wait(0.1)
            pids.add(world.process.pid)
    assert len(pids) == 1
    assert handle.constructed.settings["timestep"] == 0.001


def test_two_episodes_at_once_are_an_error(handle: SimulatorHandle) -> None:
    with handle.episode(SCENE) as world:
        with (
            pytest.raises(RuntimeError, match="an episode of mujoco is still open"),
            handle.episode(SCENE),
        ):
            pass
        world.wait(0.1)  # the first one goes on
    with handle.episode(SCENE):
        pass


class Interrupted(BaseException):
    """What a time-out of a test raises, anywhere."""


def test_an_interrupted_request_leaves_no_stale_answer(handle: SimulatorHandle) -> None:
    def interrupt(*_: object) -> None:
        raise Interrupted

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        with pytest.raises(Interrupted), handle.episode(SCENE) as world:  # noqa: PT012
            pid = world.process.pid
            signal.setitimer(signal.ITIMER_REAL, 0.3)
            world.wait(10000.0)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    with handle.episode(SCENE) as world:
        assert world.process.pid != pid
        world.wait(0.1)
        assert world.time == pytest.approx(0.1)


def test_a_failing_test_keeps_its_worker_and_tells_how_to_replay(
    handle: SimulatorHandle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(AssertionError) as caught, handle.episode(SCENE) as world:  # noqa: PT012
        pid = world.process.pid
        world.wait(0.3)
        end = world.pose("a").position
        raise AssertionError("too low")
    (note,) = caught.value.__notes__
    (path,) = (tmp_path / "examples").iterdir()
    assert note.startswith("replay this episode: simbench replay ")
    assert note.endswith(path.name)
    assert path.name.startswith("test_a_failing_test_keeps_its_worker")
    with handle.episode(SCENE) as world:
        assert world.process.pid == pid
    assert main(["replay", str(path)]) == 0
    told = capsys.readouterr().out
    assert told.startswith("mujoco headless tuned, t = 0.300 s")
    assert f"a: {end[0]:.4f} {end[1]:.4f} {end[2]:.4f} m" in told


def test_a_crash_is_replayed_up_to_it(handle: SimulatorHandle, tmp_path: Path) -> None:
    with pytest.raises(WorkerExited) as caught, handle.episode(SCENE) as world:  # noqa: PT012
        world.wait(0.1)
        assert world.process.pid is not None
        os.kill(world.process.pid, signal.SIGKILL)
        world.wait(0.2, striking=True)
    assert "replay this episode" in caught.value.__notes__[0]
    (path,) = (tmp_path / "examples").iterdir()
    example = read_example(path, tmp_path)
    assert example.scene == SCENE
    assert [dict(operation.arguments) for operation in example.tape] == [
        {"duration": 0.1},
        {"duration": 0.2, "striking": True},
    ]
    with handle.episode(SCENE) as world:
        world.wait(0.1)


def test_the_last_failure_stays(handle: SimulatorHandle, tmp_path: Path) -> None:
    """As Hypothesis ends with the smallest example."""
    for height in (0.5, 0.3):
        scene = SCENE.with_pose("a", Pose.at(0, 0, height))
        with pytest.raises(AssertionError), handle.episode(scene):
            raise AssertionError
    (path,) = (tmp_path / "examples").iterdir()
    assert read_example(path, tmp_path).scene.body("a").pose.position[2] == 0.3


def test_giving_an_example_up_is_no_failure(handle: SimulatorHandle, tmp_path: Path) -> None:
    with pytest.raises(UnsatisfiedAssumption), handle.episode(SCENE):
        raise UnsatisfiedAssumption
    assert not (tmp_path / "examples").exists()


TAPE = [Operation("wait", {"duration": 0.1}, "fall")]
EVIL = "\x1b]0;owned\x07\x1b[2Jred\r\u202e"


@pytest.fixture
def path(case: Case) -> Path:
    path = write_example(case, "episode", SCENE, TAPE, {"mujoco": "3.0.0"})
    return path.rename(case.folder / "episode.json")


def changed(path: Path, *keys: Any, to: Any) -> Path:
    """The file with the value at these keys replaced."""
    data = place = json.loads(path.read_text())
    for key in keys[:-1]:
        place = place[key]
    place[keys[-1]] = to
    path.write_text(json.dumps(data))
    return path


@pytest.mark.engine
def test_what_a_file_says_of_starting_is_not_looked_at(
    path: Path, case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file of the first schema, made to be passed on."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    victim = tmp_path / "executed"
    (tmp_path / "evil.py").write_text(f"open({str(victim)!r}, 'w').close()\nclass Evil: pass\n")
    shell = tmp_path / "shell"
    shell.write_text(f"#!/bin/sh\ntouch {victim}\n")
    shell.chmod(0o755)
    data = json.loads(path.read_text())
    data["schema"] = 1
    data["case"] |= {
        "python": str(shell),
        "spec": f"popen//python=sh -c 'touch {victim}'",
        "adapter": "evil:Evil",
        "environment": {"PYTHONSTARTUP": str(tmp_path / "evil.py"), "LD_PRELOAD": "evil.so"},
        "stall_timeout": 1e9,
        "folder": str(tmp_path / "there"),
        "costly_start": True,
        "compile_timeout": 1e9,
    }
    path.write_text(json.dumps(data))
    found = read_example(path, tmp_path / "logs").case
    assert found == Case(
        test=case.test,
        simulator="mujoco",
        mode="headless",
        profile="tuned",
        adapter="pytest_simbench.sims.mujoco.adapter:MuJoCo",
        folder=tmp_path / "logs",
        deterministic=True,
        compile_timeout=900.0,
    )
    assert main(["replay", str(path)]) == 0
    assert not victim.exists()
    assert not (tmp_path / "there").exists()


def test_this_machine_says_how_it_is_run(
    path: Path, case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own: dict[str, Any] = {"mode": "gui", "python": "p", "spec": "s"}
    changes = {"cone": "elliptic"}
    found = read_example(changed(path, "case", "changes", to=changes), tmp_path / "logs", **own)
    known = Case.of("mujoco", test=case.test, profile="tuned", folder=tmp_path / "logs", **own)
    assert found == Example(replace(known, changes=changes), SCENE, TAPE, {"mujoco": "3.0.0"})
    monkeypatch.setattr(example, "missing", lambda info: f"no {info.name} here")
    with pytest.raises(ExampleError, match="no mujoco here"):
        read_example(path, tmp_path)
    for elsewhere in ({"python": "p"}, {"spec": "s"}):  # nothing is asked of this machine
        assert read_example(changed(path, "schema", to=1), tmp_path, **elsewhere).tape == TAPE


def test_one_of_the_same_test_and_name_is_replaced(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, at, of in (("a", "t (setup)", "x"), ("a", "t (call)", "x"), ("b", "t (call)", "x"),
                         ("a", "u (call)", "x"), ("a", "t (call)", "y")):  # fmt: skip
        monkeypatch.setenv("PYTEST_CURRENT_TEST", at)
        write_example(replace(case, test=of), name, SCENE, [])
    assert len(list((case.folder / "examples").iterdir())) == 4


@pytest.mark.engine
def test_another_version_is_said(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", str(path)]) == 0
    note, result, _ = capsys.readouterr().out.splitlines()
    assert note.startswith("note: the file was made with mujoco 3.0.0, this is ")
    assert result == "mujoco headless tuned, t = 0.100 s"


@pytest.mark.parametrize("robot", [panda(squeeze=10.0), find("ur5")], ids=lambda robot: robot.name)
def test_a_built_in_robot_is_this_machine_s(case: Case, tmp_path: Path, robot: Robot) -> None:
    rows = dict.fromkeys(ARRAYS, np.zeros((2, len(robot.joints))))
    tape = [Operation("wait", {"duration": 86_400.0}), Operation("follow", {"tick": 600.0, **rows})]
    path = write_example(case, "robot", replace(SCENE, robot=robot), tape)
    assert "/" not in json.dumps(json.loads(path.read_text())["scene"])  # no path of ours
    for key, value in (("urdf", "/etc/passwd"), ("packages", {"x": "/"}), ("srdf", "/dev/zero")):
        changed(path, "scene", "robot", key, to=value)
    found = read_example(path, tmp_path, python="p")
    assert found.scene.robot == robot
    assert [one.to_wire() for one in found.tape] == [one.to_wire() for one in tape]
    assert {found.tape[1].arguments[name].shape for name in ARRAYS} == {(2, len(robot.joints))}


def test_a_robot_of_unknown_files_needs_a_word(
    case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = replace(SCENE, robot=replace(panda(), name="mine"))
    path = write_example(case, "robot", scene, TAPE)
    assert main(["replay", str(path)]) == 2
    assert (
        "robot 'mine' is not known here (known: panda, so101, ur10, ur5, xarm7), and the files "
        "that describe it are not read at a file's word; give --trust-robot if you know where the "
        in capsys.readouterr().err
    )
    assert read_example(path, tmp_path, python="p", trust_robot=True).scene == scene
    assert replay_command(path, case, scene).endswith(f"{path.name} --trust-robot")
    assert main(["replay", str(path), "--trust-robot", "--python=/nowhere/python"]) == 1


def test_the_line_says_how_it_was_started_here(case: Case, tmp_path: Path) -> None:
    path = tmp_path / "x y.json"
    own, begin = replace(case, python=sys.executable), f"simbench replay '{path}'"
    assert replay_command(path, own, SCENE) == f"{begin} --python={sys.executable}"
    own = replace(own, spec="ssh=there//python=py")
    assert replay_command(path, own, SCENE) == f"{begin} --spec=ssh=there//python=py"
    assert replay_command(path, case, SCENE) == begin


@pytest.mark.engine
def test_another_interpreter_is_the_user_s_to_name(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", str(path), f"--python={sys.executable}"]) == 0
    assert main(["replay", str(path), "--python=/nowhere/python"]) == 1
    assert "/nowhere/python" in capsys.readouterr().err


FOLLOW = {"tick": 0.1, "position": [[0.0]], "velocity": [[0.0]], "effort": [[0.0]]}
BOX = cube("a", Pose.at(0.0, 0.0, 0.2), WHITE).to_wire()

# Scenes and settings that are none: tests/scene/test_checks.py, tests/simulator/test_settings.py.
BROKEN: list[tuple[tuple[Any, ...], Any]] = [
    (("schema",), 0), (("schema",), 3), (("schema",), "1"), (("case",), [1]),
    (("case", "simulator"), "nowhere"), (("case", "simulator"), 3), (("case", "simulator"), EVIL),
    (("case", "mode"), "magic"), (("case", "profile"), "best"), (("case", "versions"), [1]),
    (("case", "changes"), {"timestep": "x"}), (("scene",), None), (("scene", "bodies"), [3]),
    (("scene", "bodies"), [BOX, BOX]), (("scene", "bodies"), [BOX] * 301), (("tape",), {}),
    (("scene", "gravity"), [0, 0]), (("scene", "robot"), {"name": "panda"}), (("tape",), [3]),
    (("scene", "bodies", 0, "mass"), -1), (("scene", "bodies", 0, "name"), EVIL),
    (("scene", "bodies", 0, "pose", "quaternion"), [0, 0, 0, 0]), (("tape", 0, "kind"), "exec"),
    (("tape", 0, "phase"), None), (("tape", 0, "arguments"), {"duration": True}),
    (("tape", 0, "arguments"), {"duration": -1}), (("tape", 0, "arguments"), {"duration": 1e9}),
    (("tape", 0, "arguments"), {"duration": 1, "op": "close"}), (("scene", "robot"), 3),
    (("tape", 0, "arguments"), {"duration": 1, "striking": 1}),
    (("tape", 0), {"kind": "follow", "arguments": FOLLOW, "phase": ""}),
]  # fmt: skip


@pytest.mark.parametrize(("keys", "value"), BROKEN, ids=lambda value: ascii(value)[:30])
def test_something_else_in_it_is_a_sentence(
    path: Path, keys: tuple[Any, ...], value: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", str(changed(path, *keys, to=value)), "--python=p"]) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"simbench replay: {path}")
    assert told.count("\n") == 1
    place = f"{'.'.join(map(str, keys))} = {value!a:.40}"
    assert_approved_line("episodes", f"{place} | {told.partition(f'{path}')[2].strip()}")
    assert_harmless_terminal(told)


MOTIONS = {
    "joints": [[0.0] * 8], "ragged": [[0.0] * 9, [0.0]], "texts": [["x"] * 9], "none": [[None] * 9],
    "empty": [], "lengths": [[0.0] * 9] * 2, "long": [[0.0] * 9] * 10_000,
}  # fmt: skip


@pytest.mark.parametrize("what", MOTIONS)
def test_a_motion_that_is_none(case: Case, tmp_path: Path, what: str) -> None:
    motion: dict[str, Any] = dict.fromkeys(ARRAYS, MOTIONS[what])
    if what == "lengths":
        motion["effort"] = motion["effort"][:1]
    wrong = [Operation("follow", {"tick": 0.1, **motion})]
    path = write_example(case, "motion", replace(SCENE, robot=panda()), wrong)
    path = path.rename(tmp_path / f"{what}.json")
    with pytest.raises(ExampleError, match="motion"):
        read_example(path, tmp_path)


@pytest.mark.parametrize(
    "text",
    ["", "{}", "[1]", "nonsense", '{"case": {"x": 1}, "scene": 1, "tape": []}', "[" * 100_000,
     '{"schema": 2, "case": NaN}', '{"schema": 2, "case": 1e999}', "\udcff"],
    ids=range(9),
)  # fmt: skip
def test_a_file_that_holds_no_episode(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "x.json"
    path.write_text(text, errors="surrogateescape")
    with pytest.raises(ExampleError, match="holds no episode of pytest-simbench: "):
        read_example(path, tmp_path)
    assert main(["replay", str(path)]) == 2
    assert capsys.readouterr().err.startswith(
        f"simbench replay: {path} holds no episode of pytest-simbench: "
    )


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=10,
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=300)
@given(
    where=st.sampled_from([keys for keys, _ in BROKEN] + [("case", "test")]),
    value=JSON,
)
def test_whatever_is_in_it_nothing_else_is_raised(
    path: Path, tmp_path: Path, where: tuple[Any, ...], value: Any
) -> None:
    before = path.read_text()
    try:
        read_example(changed(path, *where, to=value), tmp_path)
    except ExampleError as error:
        assert_harmless_terminal(str(error))
    finally:
        path.write_text(before)


def test_what_is_no_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo(tmp_path / "pipe")
    with (tmp_path / "large").open("wb") as file:
        file.truncate(LARGEST + 1)
    for name, said in (
        ("none.json", "No such file"),
        ("pipe", "it is a pipe"),
        ("large", "it is larger than 64 MB"),
    ):
        assert main(["replay", str(tmp_path / name)]) == 2
        assert said in capsys.readouterr().err


def test_a_worker_that_fails_is_a_sentence(
    path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        from pytest_simbench.client.errors import EngineFailed, Where

        raise EngineFailed(f"no {EVIL}", Where("mujoco", "headless"))

    monkeypatch.setattr("pytest_simbench.repeatability.example._replay", fails)
    assert main(["replay", str(path), "--python=p"]) == 1
    told = capsys.readouterr().err
    assert told.startswith(r"no \x1b]0;owned")
    assert_harmless_terminal(told)
