"""A search over settings whose repetitions two nodes carry out."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pytest_simbench.cli.main import main
from tests.cluster.machines import Machines

pytest.importorskip("distributed", reason="a cluster needs the extra 'cluster'")
pytest.importorskip("optuna")
pytest.importorskip("mujoco")

TEST = """
import time
from tests.tiny import Falling

class Slow(Falling):
    def perform(self, world, seed, count):
        time.sleep(1.0)
        return super().perform(world, seed, count)

def test_falls(repeat):
    repeat(Slow()).assert_at_least("landed", 0.9)
"""


def test_two_nodes_share_one_search(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """And it finds what it finds on this machine, within the budget, in which two run at once."""
    monkeypatch.chdir(tmp_path)
    Path("test_shared.py").write_text(TEST)
    words = ["tune", "test_shared.py::test_falls", "--sim", "mujoco", "--trials", "2"]
    words += ["--settings", "timestep", "--seeds", "2", "--budget", "20s", "--output"]
    with Machines(tmp_path) as machines:
        machines.wait("head")
        for name in ("a", "b"):
            machines.node(name, "--sim", "mujoco")
        machines.wait()
        assert main([*words, "shared", "--cluster", machines.address]) == 0
    assert main([*words, "here", "--jobs", "2"]) == 0
    assert "held-out half" in capsys.readouterr().out

    found = []
    for folder in ("shared", "here"):
        lines = [*map(json.loads, Path(folder, "records.jsonl").read_text().splitlines())]
        chosen = [r for r in lines if "held_out" not in r["variant"]]
        assert folder == "here" or {r["host"]["node"] for r in chosen} == {"a", "b"}
        found.append({(r["variant"], r["seed"]): r["metrics"] for r in chosen})
        assert len(found[-1]) == len(chosen) >= 4  # each is there once
        assert len(lines) - len(chosen) <= 20  # judged
    assert found[0] == found[1]
