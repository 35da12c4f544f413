"""What only Gazebo's adapter has to show: its modules, its messages, a world that Gazebo refuses,
runs beside each other, and what a worker tells when the server ends.

Gazebo comes from no registry that CI reaches: where it is not installed, what needs it is skipped.
"""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pytest
from pytest_simbench.sims.gazebo import server
from pytest_simbench.sims.gazebo.sdf import Physics, robot_model, world_text
from pytest_simbench.sims.gazebo.settings import GazeboSettings
from pytest_simbench.sims.gazebo.window import Window

from pytest_simbench.client.errors import EngineFailed, WorkerExited, WorkerHung
from pytest_simbench.client.world import World
from pytest_simbench.scene import Box, Pose, Scene, Sphere
from pytest_simbench.simulator import PreparedRobot, UnavailableError
from pytest_simbench.tasks import Jitter, Stacking
from pytest_simbench.testing import Subject

from .gazebo_faults import FaultyGazebo
from .worlds import Worlds

CUBE = Box("cube", (0.05, 0.05, 0.05), Pose.at(0.0, 0.0, 0.025), mass=0.1)
"""Stands on the ground."""

SCENE = Stacking().scene(1, Jitter())


@pytest.fixture(scope="module")
def worlds() -> Iterator[Worlds]:
    with Worlds(FaultyGazebo) as worlds:
        yield worlds


def test_messages_have_protobufs_form() -> None:
    """As the protobuf compiler's own classes write and read them."""
    assert server.reset_request() == b"*\x02\x10\x01"
    header = b"\n\x04\n\x02\x08\x07"  # a field that is not asked for
    assert server.text_of(header + b"\x12\x05<sdf>") == "<sdf>"
    assert server.text_of(b"\x12\xac\x02" + b"x" * 300) == 300 * "x"
    assert server.text_of(b"") == ""
    for broken in (b"\x12", b"\x12\x05<sd", b"\x0b"):
        with pytest.raises(ValueError, match="the message ends too early|no wire type"):
            server.text_of(broken)


def test_no_release_is_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "RELEASES", {"7": ("json", "gz.no_such_module")})
    with pytest.raises(UnavailableError, match="no release of gz-sim .*: 7: json, gz.no_such_"):
        server.bindings.__wrapped__()


STAND_INS = """
import sys
from pytest_simbench.sims.gazebo.adapter import Gazebo
from pytest_simbench.sims.gazebo.server import bindings
from pytest_simbench.worker.server import _import_engine
for folder in sys.argv[1:]:
    sys.path[:] = [folder]
    for name in [name for name in sys.modules if name.partition(".")[0] == "gz"]:
        del sys.modules[name]
    bindings.cache_clear()
    _import_engine(Gazebo.info)
    found = bindings()
    assert [name for name in sys.modules if name[:6] == "gz.sim"] == [found.sim.__name__]
    print(found.math.__name__, found.transport.__name__, found.sim.__name__)
"""

RELEASES = {
    "math7 transport13 sim8 common5 msgs10": "gz.math7 gz.transport13 gz.sim8",
    "math8 transport14 sim9 common6 msgs11": "gz.math8 gz.transport14 gz.sim9",
    "math transport sim common msgs": "gz.math gz.transport gz.sim",
    "math transport sim math8 transport14 sim9": "gz.math8 gz.transport14 gz.sim9",
    "math7 transport13 math8 transport14 sim9": "gz.math8 gz.transport14 gz.sim9",
    "math7 transport13 sim math transport": "gz.math gz.transport gz.sim",
}
"""What is there of the package gz, and what is to be taken of it: all of one release, the oldest
that is whole. Names are those of gz-sim 8.14.0, 9.5.0 and 10.4.0."""


def test_the_modules_are_all_of_one_release(tmp_path: Path) -> None:
    """With stand-ins. Two simulators in one process would register the same messages twice."""
    folders = []
    for number, names in enumerate(RELEASES):
        folder = tmp_path / str(number) / "gz"
        folder.mkdir(parents=True)
        for name in names.split():
            (folder / f"{name}.py").touch()
        folders.append(str(folder.parent))
    done = subprocess.run(
        [sys.executable, "-c", STAND_INS, *folders], capture_output=True, text=True, check=False
    )
    assert done.stdout.splitlines() == list(RELEASES.values()), done.stderr


def test_the_release_is_read_off_the_librarys_file() -> None:
    for line, release in (
        ("7f1-7f2 r-xp 0 08:01 9  /usr/lib/x86_64-linux-gnu/libgz-sim8.so.8.14.0", "8.14.0"),
        ("7f1-7f2 r-xp 0 08:01 9  /usr/lib/x86_64-linux-gnu/libgz-sim.so.10.4.0", "10.4.0"),
        ("7f1-7f2 r-xp 0 08:01 9  /opt/lib/libgz-sim8.so.8.14.0 (deleted)", "8.14.0"),
        ("7f1-7f2 r-xp 0 08:01 9  /opt/lib/libgz-sim8-physics-system.so.8.14.0", None),
    ):
        found = server.LIBRARY.search(line)
        assert (found and found[1]) == release


def test_the_world_is_that_of_the_engine(tmp_path: Path) -> None:
    """Joints are 0 where the scene has them start; a name is a body's or the robot's."""
    scene = replace(SCENE, bodies=(replace(CUBE, name="robot", pose=Pose.at(1.0, 1.0, 0.025)),))
    prepared = PreparedRobot(SCENE.robot)
    for engine, elements in (("dartsim", "ode/mu"), ("bullet-featherstone", "bullet/friction")):
        physics = Physics(GazeboSettings(engine=engine, torsional_friction=0.25))
        world = ET.fromstring(world_text(scene, prepared, physics, "w", tmp_path)).find("world")
        assert world.findtext("plugin/engine/filename") == f"gz-physics-{engine}-plugin"
        assert world.find(f"model/link/collision/surface/friction/{elements}") is not None
        twist = world.findtext("model/link/collision/surface/friction/torsional/coefficient")
        assert twist == {"dartsim": None, "bullet-featherstone": "0.25"}[engine]
        model = world.find(f"model[@name='{robot_model(scene)}']")
        assert len(world.findall("model[@name='robot']")) == 1
        for joint in SCENE.robot.joints:
            limit = model.find(f"joint[@name='{joint.name}']/axis/limit")
            found = [float(limit.findtext(what, "")) for what in ("lower", "upper")]
            expected = prepared.limits[joint.name] - joint.initial_position
            np.testing.assert_allclose(found, expected)


def test_it_starts_where_the_scene_does(worlds: Worlds) -> None:
    """The server has made a step by then, and was reset."""
    world = worlds.load(Scene("falling", (CUBE.moved_to(Pose.at(0.0, 0.0, 1.0)),)))
    np.testing.assert_array_equal(world.bodies[0, :3], (0.0, 0.0, 1.0))
    np.testing.assert_array_equal(world.bodies[0, 7:], np.zeros(6))
    world.wait(0.1)
    assert world.bodies[0, 9] == pytest.approx(-0.980665, rel=1e-6)


def test_what_gazebo_refuses_is_told_in_its_own_words(worlds: Worlds) -> None:
    with pytest.raises(EngineFailed, match="Gazebo refused the world: .*no_such_link"):
        worlds.load(SCENE, fault="refused")


def test_worlds_leave_nothing_in_a_worker(worlds: Worlds) -> None:
    """Each left 28 MB once."""
    worlds.load(Scene("one", (CUBE,)))
    process = psutil.Process(worlds.worker.pid)
    before = process.memory_info().rss
    for _ in range(3):
        worlds.load(Scene("one", (CUBE,)))
    assert process.memory_info().rss - before < 20e6


def test_two_runs_do_not_meet(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a partition that the user named: a world that is loaded is reset, and no other one is."""
    monkeypatch.setenv("GZ_PARTITION", "shared")
    scene = Scene("falling", (CUBE.moved_to(Pose.at(0.0, 0.0, 1.0)),))
    with Worlds(FaultyGazebo) as some, Worlds(FaultyGazebo) as others:
        first = some.load(scene)
        first.wait(0.1)
        second = others.load(scene)
        for world in (first, second):
            world.wait(0.1)
        assert first.bodies[0, 9] == pytest.approx(2 * second.bodies[0, 9], rel=1e-6)


@pytest.mark.parametrize(
    ("number", "told"), [(signal.SIGKILL, "SIGKILL"), (signal.SIGTERM, "SIGTERM")]
)
def test_a_server_that_is_ended(number: signal.Signals, told: str) -> None:
    """The server is in the worker: its end is the worker's, and no handler of Gazebo's hides it."""
    with Worlds(FaultyGazebo) as worlds:
        world = worlds.load(Scene("one", (CUBE,)))
        os.kill(worlds.worker.pid, number)
        with pytest.raises(WorkerExited, match=told):
            world.wait(5.0)


def test_a_server_that_is_stopped() -> None:
    """It is waited for as long as for any worker that is silent, and then killed."""
    with Worlds(FaultyGazebo) as worlds:
        world, process = worlds.load(Scene("one", (CUBE,))), worlds.worker
        process.launch = replace(process.launch, stall_timeout=3.0)
        os.kill(process.pid, signal.SIGSTOP)
        with pytest.raises(WorkerHung, match="no sign of life for 3 s and was killed; raise --sim"):
            world.wait(5.0)
        assert not process.alive


STAND_IN = """#!/bin/sh
trap 'echo ended >> {record}; exit 0' TERM
echo "$@" > {record}; echo "$GZ_PARTITION" >> {record}
{then}
"""

WAITS = "while true; do sleep 0.05; done"


@pytest.fixture
def record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What a stand-in for the program `gz` was called with, was told, and whether it ended."""
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    stand_in(tmp_path / "record", WAITS)
    return tmp_path / "record"


def stand_in(record: Path, then: str) -> None:
    program = record.with_name("gz")
    program.write_text(STAND_IN.format(record=record, then=then))
    program.chmod(0o755)


def lines(record: Path) -> list[str]:
    """Of what it has written, the first two at least."""
    until = time.monotonic() + 20.0
    while time.monotonic() < until:
        if record.exists() and len(found := record.read_text().splitlines()) > 1:
            return found
        time.sleep(0.02)
    raise TimeoutError("the stand-in was not called")


def test_a_window_is_opened_and_closed(record: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the server's partition, with the server's release."""
    monkeypatch.setenv("GZ_PARTITION", "ours")
    window = Window("8.14.0", "install it", start=0.5)
    assert lines(record)[:2] == ["sim -g --force-version 8.14.0", "ours"]
    window.close()
    assert lines(record)[2:] == ["ended"]
    assert window.program.ended() == "exited with status 0"


def test_a_window_that_cannot_be_opened(record: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without its libraries, without the program: the test is skipped, and says what installs it.
    One that the user closes ends nothing."""
    stand_in(record, "echo 'no display' >&2; exit 1")
    with pytest.raises(UnavailableError, match="exited with status 1 .*: no display; install it$"):
        Window("", "install it", start=20.0)
    assert lines(record)[0] == "sim -g"
    stand_in(record, WAITS)
    window = Window("", "install it", start=0.5)
    window.program.kill()
    window.close()
    monkeypatch.setenv("PATH", str(record))
    with pytest.raises(UnavailableError, match="gz, which is not on the PATH; install it$"):
        Window("", "install it")


def test_what_is_drawn_is_what_collides(tmp_path: Path) -> None:
    """In the scene's colours, and only where there is a window."""
    prepared = PreparedRobot(SCENE.robot)
    physics = Physics(GazeboSettings())
    plain = ET.fromstring(world_text(SCENE, prepared, physics, "w", tmp_path))
    world = ET.fromstring(world_text(SCENE, prepared, physics, "w", tmp_path, drawn=True)).find(
        "world"
    )
    assert plain.find("world/model/link/visual") is None
    assert plain.find("world/plugin[2]") is None
    names = [plugin.get("name", "") for plugin in world.findall("plugin")]
    assert names == ["gz::sim::systems::Physics", "gz::sim::systems::SceneBroadcaster"]
    solids, drawn = (
        [
            [ET.tostring(part).strip() for part in shape if part.tag in ("pose", "geometry")]
            for shape in world.findall(f"model/link/{kind}")
            if shape.find("geometry/plane") is None
        ]
        for kind in ("collision", "visual")
    )
    assert drawn == solids
    assert len(drawn) > 30
    red = world.findtext("model[@name='cube_05']/link/visual/material/diffuse")
    assert red == " ".join(str(float(value)) for value in SCENE.body("cube_05").colour)


def test_a_window_sees_its_server_and_no_other(record: Path) -> None:
    """The stand-in is told the partition of the worker that has opened it."""
    with Worlds(FaultyGazebo) as worlds:
        Subject(FaultyGazebo).construct(worlds.worker, gui=True)
        world = World(worlds.worker, Scene("one", (CUBE,)))
        partition = lines(record)[1]
        assert partition.startswith(f"simbench-{worlds.worker.pid}-")
        world.wait(0.1)
        assert world.bodies[0, 2] == pytest.approx(0.025, abs=1e-3)
    assert lines(record)[2:] == ["ended"]


def test_a_lone_body_slides_alike_on_each_side(worlds: Worlds) -> None:
    """It stands, or lies with its z axis along the way or across it: it loses mu g in all three."""
    half, mu = math.sqrt(0.5), 0.2
    for turn in ((1.0, 0.0, 0.0, 0.0), (half, half, 0.0, 0.0), (half, 0.0, half, 0.0)):
        pose = Pose((0.0, 0.0, 0.025), turn)
        cube = replace(CUBE, pose=pose, friction=mu, linear_velocity=(1.0, 0.0, 0.0))
        world = worlds.load(Scene("sliding", (cube,), ground_friction=mu))
        world.wait(0.3)
        assert world.bodies[0, 7] == pytest.approx(1 - 0.3 * mu * 9.80665, abs=0.01)


def test_a_spin_on_the_ground(worlds: Worlds) -> None:
    """SDF's default holds a ball that spins on the spot; that of `tuned`, 0, lets it spin on."""
    ball = Sphere("ball", 0.03, Pose.at(0.0, 0.0, 0.03), 0.1, angular_velocity=(0.0, 0.0, 6.0))
    spins = []
    for changes in ({"torsional_friction": 1.0}, {}):
        world = worlds.load(Scene("spinning", (ball,)), **changes)
        world.wait(0.1)
        spins.append(float(world.bodies[0, 12]))
    np.testing.assert_allclose(spins, [0.0, 6.0], atol=0.01)
