"""A cluster that loses nodes and gets one, against one machine: are the records the same?

    python benchmarks/cluster_faults.py [--reps 20] [--processes]

A head and three nodes, each in a network namespace of its own (root alone; else, and with
`--processes`, processes on loopback), with its own environments folder and offers. Three simulators
let towers lean, so many times each. In the middle one node is killed, one is cut off
(`ip link set ... down`; a process is stopped) and one is added. Then the same runs on this machine
alone, and the records are compared: byte for byte but for times and node, nothing twice, nothing
lost.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))

from tests.cluster.machines import Machines, networks_allowed  # noqa: E402

SIMULATORS = ("mujoco", "pybullet", "drake")
TEST = """
from pytest_simbench.tasks import LeaningTowers


def test_towers(repeat):
    repeat(LeaningTowers())
"""
OFFERS = {"a": "mujoco,pybullet", "b": "pybullet,drake", "c": "mujoco,drake"}
ADDED = "mujoco,pybullet,drake"
TIMES = ("seconds", "stepping", "timeline", "resources")


def pytest_run(folder: Path, reps: int, *arguments: str) -> subprocess.Popen[bytes]:
    (folder.parent / "test_towers.py").write_text(TEST)
    command = [sys.executable, "-m", "pytest", "test_towers.py", f"--sim={','.join(SIMULATORS)}"]
    command += [f"--reps={reps}", f"--sim-output={folder}", "-p", "no:cacheprovider", *arguments]
    log = folder.with_suffix(".log").open("wb")
    return subprocess.Popen(command, cwd=folder.parent, stdout=log, stderr=subprocess.STDOUT)


def records(folder: Path) -> list[dict[str, Any]]:
    path = folder / "records.jsonl"
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text().splitlines() if line.endswith("}")]


def alike(record: dict[str, Any]) -> str:
    """What must be the same wherever it ran, as JSON."""
    kept = {key: value for key, value in record.items() if key not in TIMES}
    kept["host"] = {k: v for k, v in record["host"].items() if k != "node"}
    kept["notes"] = {k: v for k, v in record["notes"].items() if k != "lost_nodes"}
    return json.dumps(kept)


def key(record: dict[str, Any]) -> tuple[str, int]:
    return record["simulator"], record["repetition"]


def disturbed(machines: Machines, run: subprocess.Popen[bytes], out: Path, reps: int) -> None:
    """Kill a, cut b off and add d, each when so many records are there."""
    total = reps * len(SIMULATORS)

    def kill() -> None:
        machines.kill("a")

    def cut() -> None:
        machines.cut("b")

    def add() -> None:
        machines.node("d", "--sim", ADDED, environment=environment(machines.folder, "d"))

    for share, what in ((0.1, kill), (0.4, cut), (0.4, add)):
        while len(records(out)) < share * total and run.poll() is None:
            time.sleep(0.2)
        if run.poll() is not None:
            raise SystemExit(f"the run ended too early: {out.with_suffix('.log')}")
        print(f"{len(records(out)):3} records: {what.__name__}", flush=True)
        what()


def environment(folder: Path, name: str) -> dict[str, str]:
    own = folder / f"{name}-environments"
    own.mkdir()
    return {"SIMBENCH_ENVIRONMENTS": str(own), "HOME": str(folder), "TERM": "dumb"}


def main() -> None:
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("terminated"))  # networks are taken down
    parser = argparse.ArgumentParser()
    parser.add_argument("--reps", type=int, default=20)
    parser.add_argument("--processes", action="store_true", help="no network namespaces")
    given = parser.parse_args()
    networks = not given.processes and networks_allowed()
    folder = Path(tempfile.mkdtemp(prefix="simbench-cluster-"))
    print("networks of their own" if networks else "processes on loopback", folder, flush=True)
    with Machines(folder, lost_after=10.0, networks=networks) as machines:
        machines.wait("head")
        for name, sims in OFFERS.items():
            machines.node(name, "--sim", sims, environment=environment(folder, name))
        machines.wait()
        began = time.monotonic()
        out = folder / "cluster"
        run = pytest_run(out, given.reps, f"--sim-cluster={machines.address}")
        disturbed(machines, run, out, given.reps)
        status = run.wait()
        spread = time.monotonic() - began
    began = time.monotonic()
    alone = pytest_run(folder / "alone", given.reps)
    print(f"exit status {status} on the cluster, {alone.wait()} alone")
    print(f"{spread:.0f} s on the cluster, {time.monotonic() - began:.0f} s alone")
    found, expected = records(out), records(folder / "alone")
    twice = [k for k, n in Counter(map(key, found)).items() if n > 1]
    missing = set(map(key, expected)) - set(map(key, found))
    straight = {key(r): alike(r) for r in expected}
    other = [key(r) for r in found if alike(r) != straight.get(key(r))]
    print("nodes:", dict(sorted(Counter(r["host"]["node"] for r in found).items())))
    for record in found:
        if record["notes"].get("lost_nodes"):
            print("tried again:", *key(record), record["status"], record["notes"]["lost_nodes"])
    print(
        f"{len(found)} records, {len(expected)} alone; twice: {twice}; missing: {sorted(missing)}"
    )
    print(f"different: {other}")
    if twice or missing or other or len(found) != len(expected) or os.environ.get("KEEP"):
        raise SystemExit(f"kept in {folder}" + ("" if os.environ.get("KEEP") else ": NOT the same"))
    print("the same records")


if __name__ == "__main__":
    main()
