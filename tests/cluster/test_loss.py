"""Nodes are lost and come, and each record is there once; who can reach a cluster and its pages."""

from __future__ import annotations

import http.client
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from textwrap import dedent
from typing import Any

import psutil
import pytest

from pytest_simbench.client.errors import NodeLost
from pytest_simbench.cluster.executor import ClusterExecutor
from pytest_simbench.cluster.pool import Pool
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.simulator.registry import adapter
from tests.cluster.machines import Machines, networks_allowed, release_in
from tests.plugin.test_same_records import TIMES
from tests.tiny import Falling

pytest.importorskip("distributed", reason="a cluster needs the extra 'cluster'")

TEST = """
    import errno, os, signal, time
    from pathlib import Path
    from tests.tiny import Falling

    class Slow(Falling):
        def perform(self, world, seed, count):
            outcome = super().perform(world, seed, count)
            outcome.details["bodies"] = world.bodies  # every bit of the state at the end
            if trouble := os.environ.get("TROUBLE"):  # on nodes alone
                began = Path(trouble, f"{seed}-{os.getpid()}")
                began.touch()
                time.sleep(1.0)
                if seed == 10003 and len(list(Path(trouble).glob("10003-*"))) == 1:
                    os.kill(os.getpid(), signal.SIGKILL)  # as a simulator may
                if seed == 10008:
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))  # wherever it runs
            return outcome

    def test_one(repeat):
        repeat(Slow())
"""
FULL = 10008
"""The seed at which every node's disk is full."""


@pytest.fixture(scope="module")
def machines(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Machines]:
    """A head, and the nodes a and b; each has a network of its own, where that is allowed."""
    folder = tmp_path_factory.mktemp("machines")
    trouble = folder / "trouble"
    trouble.mkdir()
    with Machines(folder, lost_after=10.0, networks=networks_allowed()) as found:
        found.wait("head")
        environments = folder / "environments"
        release = release_in(environments)
        for name, sims in (("a", f"mujoco,{release}"), ("b", "mujoco")):
            own = {"TROUBLE": str(trouble), "SIMBENCH_ENVIRONMENTS": str(environments)}
            found.node(name, "--sim", sims, environment=own)
        found.wait()
        yield found


def pytest_in(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    (folder / "test_it.py").write_text(dedent(TEST))
    return subprocess.Popen(
        [sys.executable, "-m", "pytest", "--sim=mujoco", "--reps=8", *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.getcwd()},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def records(folder: Path) -> dict[int, dict[str, Any]]:
    """By seed; each is there once."""
    found = [json.loads(line) for line in (folder / "out" / "records.jsonl").open()]
    by_seed = {record["seed"]: record for record in found}
    assert len(by_seed) == len(found)
    return by_seed


def alike(record: dict[str, Any]) -> dict[str, Any]:
    """What must be the same wherever it ran."""
    host = {k: v for k, v in record["host"].items() if k != "node"}
    notes = {k: v for k, v in record["notes"].items() if k != "lost_nodes"}
    kept = {k: v for k, v in record.items() if k not in TIMES}
    return {**kept, "host": host, "notes": notes}


def until(condition: Any, seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


def wait_for(machines: Machines, name: str) -> None:
    """Until a node is there whose process another test has ended."""
    pool = Pool(machines.address)
    until(lambda: name in {node.name for node in pool.nodes()})
    pool.close()


def test_a_process_killed_a_machine_cut_off_and_one_added(
    machines: Machines, tmp_path: Path
) -> None:
    straight, spread = tmp_path / "straight", tmp_path / "spread"
    straight.mkdir()
    spread.mkdir()
    alone = pytest_in(straight, "--sim-output=out")
    assert alone.wait() == 0, alone.stdout and alone.stdout.read()
    run = pytest_in(
        spread, "--sim-output=out", f"--sim-cluster={machines.address}", "--sim-crashes=1"
    )
    trouble = machines.folder / "trouble"
    until(lambda: len(list(trouble.glob("*"))) >= 2)
    machines.cut("b")  # nothing comes from it any more, and nobody says so
    machines.node("d", "--sim", "mujoco", environment={"TROUBLE": str(trouble)})
    out, _ = run.communicate(timeout=400)
    assert run.returncode == 0, out
    assert "of them failed for it" in out
    expected, found = records(straight), records(spread)
    assert found.keys() == expected.keys()
    lost = found.pop(FULL)
    assert (lost["status"], lost["error"]["type"]) == ("failed", "NodeLost")
    assert len(lost["notes"]["lost_nodes"]) == 2
    assert "it cannot: No space left on device, then on" in lost["error"]["message"]
    assert {s: alike(r) for s, r in found.items()} == {s: alike(expected[s]) for s in found}
    again = {
        seed: r["notes"]["lost_nodes"] for seed, r in found.items() if "lost_nodes" in r["notes"]
    }
    assert "its process ended, or its network is gone" in again[10003][0]
    assert any("b: " in texts[0] for texts in again.values())
    assert "d" in {r["host"]["node"] for r in found.values()}
    assert all((spread / "out" / r["notes"]["log"]).is_file() for r in found.values())
    assert len(list((spread / "out" / "traces").iterdir())) == 1


def test_what_a_node_has_found_is_lost_with_it(machines: Machines, case: Case) -> None:
    """The repetition has ended, and then the process does, before anybody has the record."""

    class Dying:  # in here, so that it travels as code
        def __reduce__(self) -> Any:
            os.kill(os.getpid(), signal.SIGKILL)
            return object, ()

    pool = Pool(machines.address)
    pool.call = lambda job, number: {"record": Dying()}  # type: ignore[method-assign]
    record, error = ClusterExecutor(pool).repetition(Experiment(case, Falling()), 1).run()
    pool.close()
    assert isinstance(error, NodeLost), error
    assert record.status == "failed"
    assert len(record.notes.lost_nodes) == 2
    assert all("its process ended" in told for told in record.notes.lost_nodes)


def test_several_tests_at_once_and_a_release_that_one_node_has(
    machines: Machines, pytester: pytest.Pytester
) -> None:
    wait_for(machines, "a")
    pytester.makepyfile(
        """
        import pytest
        from tests.tiny import Falling

        @pytest.mark.parametrize("duration", [0.2, 0.3])
        def test_falling(repeat, duration):
            repeat(Falling(duration=duration))
        """
    )
    release = f"mujoco=={adapter('mujoco').info.tested_version}"
    result = pytester.runpytest_subprocess(
        *(f"--sim={release}", "--reps=3", "-n2", "--sim-output=out"),
        f"--sim-cluster={machines.address}",
    )
    result.assert_outcomes(passed=2)
    found = [json.loads(line) for line in (pytester.path / "out" / "records.jsonl").open()]
    assert len({(r["test"], r["repetition"]) for r in found}) == len(found) == 6
    assert {(r["status"], r["simulator"], r["host"]["node"]) for r in found} == {
        ("ok", release, "a")
    }


def test_what_nobody_offers_is_said_before_anything_runs(
    machines: Machines, pytester: pytest.Pytester
) -> None:
    wait_for(machines, "a")
    pytester.makepyfile("def test_it(repeat): pass")
    result = pytester.runpytest_subprocess("--sim=pybullet", f"--sim-cluster={machines.address}")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    message = "*no node of the cluster offers pybullet: a has mujoco *"
    result.stderr.fnmatch_lines([message])
    assert len(result.stderr.lines) < 4


FALLING = """
    from tests.tiny import Falling

    def test_falling(repeat):
        repeat(Falling())
"""


@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl is not here")
def test_with_tls_only_who_has_a_certificate_is_served(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    """By the commands and the configuration of docs/cluster.md."""
    page = (request.config.rootpath / "docs" / "cluster.md").read_text("utf-8")
    place, nothing = pytester.mkdir("certificates"), pytester.mkdir("nothing")
    (commands,) = re.findall(r"```sh\n(umask.*?)```", page, re.DOTALL)
    subprocess.run(["sh", "-ec", commands], cwd=place, check=True, capture_output=True)
    (configuration,) = re.findall(r"```yaml\n(# ~/.config/dask.*?)```", page, re.DOTALL)
    (place / "dask.yaml").write_text(configuration.replace("/etc/simbench", str(place)))
    pytester.makepyfile(FALLING)
    monkeypatch.setenv("DASK_CONFIG", str(place))
    with Machines(pytester.mkdir("machines"), head=["--tls"]) as machines:
        machines.node("a", "--sim", "mujoco")
        machines.wait("head", "a")
        arguments = ("--sim=mujoco", "--reps=1", f"--sim-cluster={machines.address}")
        pytester.runpytest_subprocess(*arguments).assert_outcomes(passed=1)
        monkeypatch.setenv("DASK_CONFIG", str(nothing))
        for address, message in (
            (machines.address, "tls:// needs certificates for the client"),
            (machines.address.replace("tls", "tcp"), "no scheduler of Dask answers"),
        ):
            refused = pytester.runpytest_subprocess(*arguments[:2], f"--sim-cluster={address}")
            assert refused.ret == pytest.ExitCode.USAGE_ERROR
            assert message in refused.stderr.str()
        node = [sys.executable, "-m", "pytest_simbench", "cluster", "node", machines.address]
        told = subprocess.run(node, capture_output=True, text=True, timeout=60.0)
        assert (told.returncode, "certificates for the worker" in told.stderr) == (2, True)


def answers(port: int) -> list[int]:
    """The status of each of Dask's pages at a port; none where nobody speaks HTTP."""
    found = []
    for path in ("/", "/status", "/health", "/info/main/workers.html", "/json/counts.json"):
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
        try:
            connection.request("GET", path)
            found.append(connection.getresponse().status)
        except (OSError, http.client.HTTPException):
            continue
        finally:
            connection.close()
    return found


@pytest.mark.parametrize("options", [[], ["--pages"]])
def test_pages_are_served_to_nobody_who_did_not_ask(tmp_path: Path, options: list[str]) -> None:
    with Machines(tmp_path, head=options) as machines:
        machines.wait("head")
        head = psutil.Process(machines.processes["head"].pid)
        ports = {c.laddr.port for c in head.net_connections("tcp") if c.status == "LISTEN"}
        found = [status for port in sorted(ports) for status in answers(port)]
    assert (200 in found) == bool(options)
