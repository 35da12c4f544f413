"""Which repetitions stand side by side, and what of them the page can hold."""

from __future__ import annotations

import builtins
import re
import zlib
from base64 import b64decode
from pathlib import Path
from typing import Any
from unittest.mock import Mock, call

import numpy as np
import pytest
from ruamel.yaml import YAML

from pytest_simbench.experiment.identity import file_stem_of
from pytest_simbench.records.record import Record
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.model.summary import summarise
from pytest_simbench.report.page import context
from pytest_simbench.report.page.render import render as html
from pytest_simbench.report.replay import render
from pytest_simbench.report.replay.recorded import groups, links, write_bags
from pytest_simbench.report.replay.render import ReplayUnavailable, replay_of
from pytest_simbench.report.terminal.progress import Progress
from pytest_simbench.scene import ConvexMesh, Pose
from pytest_simbench.testing.scenes import wedge
from tests.approval import assert_approved
from tests.recordings.samples import trace
from tests.report.samples import METRICS, record


def keep(run: Path, *records: Record) -> list[Record]:
    """Traces of these repetitions in a run folder."""
    for made in records:
        trace().write(run, f"traces/{file_stem_of(made)}.npz")
    return list(records)


def test_the_first_seed_of_each_task_comes_first(tmp_path: Path) -> None:
    kept = keep(
        tmp_path,
        record("drake", 2, status="failed"),
        record("drake", 1),
        record("mujoco", 1),
        record("mujoco", 1, task="throwing"),
        record("mujoco", 1, test="t[2]", settings={"task.levels": 2}),
    )
    without = record("pybullet", 1)
    found = groups(tmp_path, [*kept, without])
    assert [(g.task, g.parameters, g.seed, len(g.shown)) for g in found] == [
        ("stacking", '{"task.levels": 2}', 1001, 1),
        ("stacking", "{}", 1001, 2),
        ("throwing", "{}", 1001, 1),
        ("stacking", "{}", 1002, 1),
    ]
    addresses = links(found)
    assert addresses[id(kept[1])] == addresses[id(kept[2])] == "replay.html#1"
    assert id(without) not in addresses


def test_each_trace_is_recorded_until_the_recording_is_newer(tmp_path: Path) -> None:
    kept = keep(tmp_path, record("drake", 1, versions={"drake": "1", "numpy": "2"}), record("dart"))
    broken, to = tmp_path / f"traces/{file_stem_of(kept[1])}.npz", tmp_path / "to"
    told, soon = Mock(spec=Progress), pytest.approx(0, abs=60)
    broken.write_text("torn")
    count, (problem,) = write_bags(tmp_path, to, [*kept, record("ode")], told)
    assert (count, problem.startswith(f"no recording: {broken} holds no")) == (1, True)
    assert told.method_calls == [
        call.start_test("recordings", 2),
        call.repetition(1, 1001), call.end_repetition("ok", soon),
        call.repetition(2, 1001), call.end_repetition("failed", soon),
        call.end_test(),
    ]  # fmt: skip
    metadata = YAML(typ="safe").load(to / "recordings" / file_stem_of(kept[0]) / "metadata.yaml")
    assert metadata["rosbag2_bagfile_information"]["custom_data"] == {
        "test": "test_stacking[drake-headless]", "simulator": "drake", "mode": "headless",
        "profile": "tuned", "task": "stacking", "seed": "1001", "repetition": "1", "status": "ok",
        "versions": "drake 1, numpy 2",
    }  # fmt: skip
    keep(tmp_path, kept[1])
    assert write_bags(tmp_path, to, kept, told) == (2, [])
    assert told.method_calls[-4:-2] == [call.start_test("recordings", 1), call.repetition(1, 1001)]
    (to / "recordings").rename(tmp_path / "away")
    (to / "recordings").touch()
    wrong = f"no recording in {to / 'recordings'}: File exists"
    assert write_bags(tmp_path, to, kept, told) == (0, [wrong])


def test_the_report_leads_to_the_replay(tmp_path: Path) -> None:
    kept = keep(tmp_path, record("drake", 1), record("mujoco", 1))
    report = Report(summarise(kept, METRICS), kept)
    page = html(context.page(tmp_path, report, groups(tmp_path, kept)))
    assert page.count('"replay": "replay.html#0"') == 2
    assert '<a class="replay" href="replay.html#0">seed 1001, 2 side by side</a>' in page
    assert 'href="replay.html' not in html(context.page(tmp_path, report))


def test_a_trace_that_is_none_is_told_and_the_rest_shown(tmp_path: Path) -> None:
    kept = keep(tmp_path, record("drake", 1), record("mujoco", 1))
    (tmp_path / "traces" / f"{file_stem_of(kept[0])}.npz").write_text("no zip")
    page, count, problems = replay_of(groups(tmp_path, kept))
    assert (count, len(problems)) == (1, 1)
    assert "holds no arrays" in problems[0]
    assert '"label":"mujoco"' in page
    assert "drake" not in page
    assert replay_of(groups(tmp_path, kept[:1]))[:2] == ("", 0)  # without any trace no page


def test_what_does_not_fit_is_left_out_and_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = keep(tmp_path, *(record("drake", k) for k in range(1, 6)))
    shown = groups(tmp_path, kept)
    assert replay_of(shown)[1:] == (5, [])
    monkeypatch.setattr(render, "LARGEST", 1)
    page, count, problems = replay_of(shown)
    assert count == page.count('"seed":') == 1
    assert problems == ["the replay shows 1 of 5 seeds: more would not fit"]


def test_it_loads_nothing(tmp_path: Path) -> None:
    page = replay_of(groups(tmp_path, keep(tmp_path, record("drake", 1))))[0]
    assert "<link" not in page
    assert not re.search(r"<(script|img|iframe|link|video)[^>]* (src|href)=", page)
    assert "default-src 'none'" in page
    assert "unsafe-eval" not in page


def test_the_page_tells_what_somebody_approved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """But for what is trimesh's, the player and its style, and the motions."""
    viewer = '<head><title>x</title><meta name="viewport" x></head><body><script>y</script></body>'
    monkeypatch.setattr(render._Meshes, "viewer", lambda self: viewer)
    monkeypatch.setattr(render, "_part", "({})".format)
    monkeypatch.setattr(render, "packed", lambda of: "packed")
    kept = keep(tmp_path, record("drake", 1), record("<b>", 1, mode="gui"), record("<b>", 1))
    page = replay_of(groups(tmp_path, kept))[0]
    assert_approved("replay", page.replace("},", "},\n"))


def test_a_motion_is_packed_in_steps_of_a_tenth_of_a_millimetre() -> None:
    """And nothing is farther away than ten kilometres."""
    kept = trace()
    kept.bodies[3, 1, 0], kept.bodies[3, 1, 1] = 1e9, -1e9
    steps = np.frombuffer(zlib.decompress(b64decode(render.packed(kept))), "<i4")
    found = np.cumsum(steps.reshape(-1, len(kept.time)), axis=1).T / 10_000
    poses = np.clip(kept.bodies[:, :, :7].reshape(len(kept.time), -1), -1e4, 1e4)
    wanted = np.column_stack([kept.time, kept.joints[:, 0], poses])
    assert found == pytest.approx(wanted, abs=0.6e-4)


def test_what_is_drawn_to_scale_is_of_size_1_and_a_mesh_as_it_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    drawn: list[Any] = []
    monkeypatch.setattr("trimesh.viewer.notebook.scene_to_html", drawn.append)
    meshes = render._Meshes()
    meshes.body(ConvexMesh("wedge", wedge(), Pose.at(1.0, 0.0, 0.0), 1.0))
    meshes.viewer()
    assert list(drawn[0].graph.nodes_geometry) == ["box", "ball", "tube", "mesh_0"]
    *solids, mesh = drawn[0].geometry.values()
    assert mesh.bounds == pytest.approx(np.array([np.min(wedge(), 0), np.max(wedge(), 0)]))
    sizes = [solid.extents for solid in solids]
    assert np.array(sizes) == pytest.approx(np.ones((3, 3)), abs=0.02)


def test_missing_trimesh_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def no_trimesh(name: str, *args: Any) -> Any:
        if name.startswith("trimesh"):
            raise ImportError(name)
        return real(name, *args)

    monkeypatch.setattr(builtins, "__import__", no_trimesh)
    shown = groups(tmp_path, keep(tmp_path, record("drake", 1)))
    with pytest.raises(ReplayUnavailable, match=r"pip install 'pytest-simbench\[replay\]'"):
        replay_of(shown)
