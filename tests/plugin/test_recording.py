"""`--sim-record`: a bag for each repetition, at the end of a run and from its folder alone.
`--sim-pictures` and `--sim-video`: what is taken beside the repetitions that count."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from pytest_simbench.cli.runs import recordings
from pytest_simbench.plugin.recording import photograph, video_mode
from pytest_simbench.recordings.trace import Trace
from tests.cli.command import simbench
from tests.plugin.conftest import Configure
from tests.plugin.inner import FALLING, run_pytest
from tests.report.samples import record

TWICE = "--reps=2 --sim-output=o"


def heights(folder: Path) -> np.ndarray:
    """Of the first body, by /tf, (n,)."""
    with AnyReader([folder]) as reader:
        return np.array(
            [
                reader.deserialize(data, connection.msgtype).transforms[0].transform.translation.z
                for connection, _, data in reader.messages()
                if connection.topic == "/tf"
            ]
        )


@pytest.mark.parametrize("more", [[], ["-n2"]], ids=["plain", "xdist"])
def test_each_repetition_gets_a_bag(pytester: pytest.Pytester, more: list[str]) -> None:
    pytester.makepyfile(FALLING)
    result = run_pytest(pytester, f"{TWICE} --sim=mujoco --sim-record=mcap", *more, passed=1)
    result.stdout.fnmatch_lines(
        [
            "recordings  repetition 2 of 2  ok after *",
            "*simulator comparison*",
            "2 recordings: o/recordings",
            "report: o/report.html",
        ]
    )
    bags = sorted((pytester.path / "o" / "recordings").iterdir())
    traces = sorted((pytester.path / "o" / "traces").iterdir())
    assert [bag.name for bag in bags] == [trace.stem for trace in traces]
    for bag, trace in zip(bags, traces, strict=True):
        np.testing.assert_allclose(heights(bag), Trace.read(trace).bodies[:, 0, 2], atol=1e-6)
        told = (bag / "metadata.yaml").read_text()
        assert "simulator: mujoco" in told
        assert "test_falling[mujoco-headless]" in told


def test_what_could_not_be_recorded_fails_the_run_and_is_recorded_later(
    pytester: pytest.Pytester,
) -> None:
    pytester.makepyfile(FALLING)
    (pytester.mkdir("o") / "recordings").touch()
    result = run_pytest(pytester, f"{TWICE} --sim=mujoco --sim-record=mcap", ret=1, passed=1)
    result.stdout.fnmatch_lines(["no recording in *o/recordings: File exists"])
    assert "no traces" not in result.stdout.str()
    (pytester.path / "o" / "recordings").unlink()
    result = simbench(pytester, "report", "o", "--record=mcap")
    assert result.ret == 0
    result.stdout.fnmatch_lines(["2 recordings: o/recordings"])
    (first, _) = sorted((pytester.path / "o" / "recordings").iterdir())
    written = (first / "metadata.yaml").stat().st_mtime_ns
    (sorted((pytester.path / "o" / "traces").iterdir())[1]).write_text("no trace")
    result = simbench(pytester, "report", "o", "--record=mcap")
    assert result.ret == 1
    result.stdout.fnmatch_lines(["no recording: *holds no arrays*", "1 recording: o/recordings"])
    assert (first / "metadata.yaml").stat().st_mtime_ns == written


def test_a_run_without_traces_says_so(tmp_path: Path) -> None:
    told = ["no recordings: the run has no traces; see --sim-trace"]
    assert recordings(tmp_path, tmp_path, [record()]) == (told, True)


def test_who_has_no_renderer_films_nothing_and_is_told_of_only_where_that_was_asked_for(
    configure: Configure,
) -> None:
    told: list[str] = []
    kept: Any = SimpleNamespace(case=SimpleNamespace(simulator="dart"))
    for words in ((), ("--sim-video=on",), ("--sim-pictures",)):
        photograph(configure(*words), kept, [], told.append)
    assert told == ["dart has no renderer of its own: no pictures and no videos"] * 2
    config = configure("--sim-video=on")
    assert [video_mode(config, name) for name in ("dart", "mujoco")] == ["off", "on"]


@pytest.mark.usefixtures("drawn")
def test_pictures_and_videos_are_taken_beside_what_is_measured(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(FALLING + FALLING.replace("def test_falling", "def test_again"))
    result = run_pytest(
        pytester, f"{TWICE} --sim=mujoco,dart --sim-pictures --sim-video=first", passed=4
    )
    told = "dart has no renderer of its own: no pictures and no videos"
    assert result.stdout.str().count(told) == 1
    folder = pytester.path / "o"
    assert len((folder / "records.jsonl").read_text().splitlines()) == 8
    assert "filmed" not in (folder / "records.jsonl").read_text()
    assert (folder / "falling_pictures.png").read_bytes().startswith(b"\x89PNG")
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert 'src="data:image/png;base64,' in page
    videos = sorted(path.name for path in (folder / "videos").iterdir())
    assert [name.partition("_mujoco")[0] for name in videos] == ["test_again", "test_falling"]
    assert all(f'href="videos/{name}"' in page for name in videos)
    (folder / "falling_pictures.png").unlink()
    simbench(pytester, "report", "o")
    assert (folder / "falling_pictures.png").exists()
