"""Pictures by the engine's own renderer, beside the repetitions that count."""

from __future__ import annotations

from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.photographer import photograph
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.recordings.album import SIZE, Album
from tests.tiny import Falling


def test_a_picture_of_each_phase_and_nothing_else(case: Case) -> None:
    experiment = Experiment(case, Falling())
    Repetition(experiment, 1).run()
    before = {path.name: path.stat().st_mtime_ns for path in (case.folder / "logs").iterdir()}
    assert photograph(experiment) == ""
    (path,) = (case.folder / "pictures").glob("*.npz")
    assert path.stem == next(iter(before)).removesuffix(".log")
    pictures = Album.read(path).pictures
    assert list(pictures) == ["fall"]
    width, height = SIZE
    assert pictures["fall"].shape == (height, width, 3)
    assert pictures["fall"].std() > 1  # something is on it
    after = {path.name: path.stat().st_mtime_ns for path in (case.folder / "logs").iterdir()}
    assert after == before
    assert not (case.folder / "pictures" / "traces").exists()


def test_what_is_there_is_not_made_again(case: Case) -> None:
    experiment = Experiment(case, Falling())
    photograph(experiment)
    (path,) = (case.folder / "pictures").glob("*.npz")
    written = path.stat().st_mtime_ns
    assert photograph(experiment) == ""
    assert path.stat().st_mtime_ns == written


def test_an_engine_without_a_renderer_is_told(case: Case) -> None:
    told = photograph(Experiment(case.of("ovphysx", **of(case)), Falling()))
    assert told == "ovphysx has no renderer of its own: no pictures"


def test_what_goes_wrong_is_told(case: Case) -> None:
    lost = Experiment(case, Falling()).in_case(adapter="nowhere:Nothing")
    assert photograph(lost).startswith("mujoco: pictures end early: ")
    assert not list((case.folder / "pictures").glob("*.npz"))


def of(case: Case) -> dict[str, object]:
    return {name: getattr(case, name) for name in ("test", "mode", "profile", "folder")}
