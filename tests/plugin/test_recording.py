"""`--sim-record`: a bag for each repetition, at the end of a run and from its folder alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from pytest_simbench.recordings.trace import Trace

TEST = """
    import pytest
    from tests.tiny import Falling

    @pytest.mark.reps(2)
    def test_falling(repeat):
        repeat(Falling())
"""


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
    pytester.makepyfile(TEST)
    result = pytester.runpytest_subprocess(
        "--sim=mujoco", "--sim-output=o", "--sim-record=mcap", *more
    )
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["2 recordings: o/recordings", "report: o/report.html"])
    bags = sorted((pytester.path / "o" / "recordings").iterdir())
    traces = sorted((pytester.path / "o" / "traces").iterdir())
    assert [bag.name for bag in bags] == [trace.stem for trace in traces]
    for bag, trace in zip(bags, traces, strict=True):
        np.testing.assert_allclose(heights(bag), Trace.read(trace).bodies[:, 0, 2], atol=1e-6)
        told = (bag / "metadata.yaml").read_text()
        assert "simulator: mujoco" in told
        assert "test_falling[mujoco-headless]" in told


def test_a_kept_run_is_recorded_later(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(TEST)
    pytester.runpytest_subprocess("--sim=mujoco", "--sim-output=o", "--sim-trace=on")
    assert not (pytester.path / "o" / "recordings").exists()
    result = pytester.runpytest_subprocess("--sim-report=o", "--sim-record=mcap")
    assert result.ret == 0
    result.stdout.fnmatch_lines(["2 recordings: o/recordings"])
    (first, _) = sorted((pytester.path / "o" / "recordings").iterdir())
    written = (first / "metadata.yaml").stat().st_mtime_ns
    (sorted((pytester.path / "o" / "traces").iterdir())[1]).write_text("no trace")
    result = pytester.runpytest_subprocess("--sim-report=o", "--sim-record=mcap")
    result.stdout.fnmatch_lines(["no recording: *holds no arrays*", "1 recording: o/recordings"])
    assert (first / "metadata.yaml").stat().st_mtime_ns == written


def test_a_run_without_traces_says_so(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(TEST)
    pytester.runpytest_subprocess("--sim=mujoco", "--sim-output=o", "--sim-trace=off")
    result = pytester.runpytest_subprocess("--sim-report=o", "--sim-record=mcap")
    result.stdout.fnmatch_lines(["no recordings: the run has no traces; see --sim-trace"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--sim-record=avi"], "--sim-record=avi: choose from mcap"),
        (["--sim-record=mcap", "--sim-trace=off"], "leave --sim-trace=off out"),
    ],
)
def test_what_cannot_be_recorded_is_refused_before_anything_runs(
    pytester: pytest.Pytester, arguments: list[str], message: str
) -> None:
    pytester.makepyfile(TEST)
    result = pytester.runpytest_subprocess("--sim=mujoco", *arguments)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([f"ERROR: *{message}"])


def test_missing_rosbags_is_one_sentence_before_anything_runs(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(TEST)
    pytester.makeconftest(
        """
        import importlib.util
        find = importlib.util.find_spec
        importlib.util.find_spec = lambda name, *a: None if name == "rosbags" else find(name, *a)
        """
    )
    result = pytester.runpytest_subprocess("--sim=mujoco", "--sim-record=mcap")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: --sim-record=mcap: *pip install 'pytest-simbench[[]ros]'"])
    assert "Traceback" not in result.stdout.str() + result.stderr.str()


def test_pictures_are_taken_beside_what_is_measured(pytester: pytest.Pytester) -> None:
    pytest.importorskip("matplotlib", reason="pictures need the extra 'figures'")
    pytester.makepyfile(TEST)
    result = pytester.runpytest_subprocess("--sim=mujoco", "--sim-output=o", "--sim-pictures")
    result.assert_outcomes(passed=1)
    folder = pytester.path / "o"
    assert len((folder / "records.jsonl").read_text().splitlines()) == 2
    assert (folder / "falling_pictures.png").read_bytes().startswith(b"\x89PNG")
    assert 'src="data:image/png;base64,' in (folder / "report.html").read_text(encoding="utf-8")
    (folder / "falling_pictures.png").unlink()
    pytester.runpytest_subprocess("--sim-report=o")
    assert (folder / "falling_pictures.png").exists()
