"""Any bytes in the files of a run folder give a report or one sentence, never a traceback.

`SIMBENCH_FUZZ=2000` has it try so many examples of each kind.
"""

from __future__ import annotations

import atexit
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from pytest_simbench.description.carried import LINES as ACCOUNTS
from pytest_simbench.description.carried import Carried, keep
from pytest_simbench.experiment.identity import file_stem_of
from pytest_simbench.measure.gate import run_gate
from pytest_simbench.measure.limits import Limit
from pytest_simbench.recordings.film import Album
from pytest_simbench.recordings.trace import Trace
from pytest_simbench.records import repeatability
from pytest_simbench.records.baseline import KEY, BaselineError, read_baseline, to_extra_info
from pytest_simbench.records.claims import Claim
from pytest_simbench.records.description import TaskDescription, Threshold
from pytest_simbench.records.folder import (
    CLAIMS,
    RECORDS,
    TASKS,
    THRESHOLDS,
    RunContents,
    RunFolder,
)
from pytest_simbench.records.notes import Notes, Wait
from pytest_simbench.records.record import Failure, RecordError
from pytest_simbench.records.tuned_on import Seen
from pytest_simbench.repeatability.agreement import FOLDER as SAMPLES
from pytest_simbench.report.figures.sheet import albums
from pytest_simbench.report.files import write_files, write_outcome, write_tables
from pytest_simbench.report.model.outcome import NAME as OUTCOME
from pytest_simbench.report.model.outcome import RunOutcome
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.terminal.parts import (
    claim_lines,
    render_changes,
    render_histories,
    render_tables,
    sweep_lines,
)
from pytest_simbench.report.terminal.run import render_brief, render_run
from tests.recordings.samples import motion, scene
from tests.records.test_repeatability import LINE, REPLAY
from tests.repeatability.test_agreement import TIMES, sample
from tests.report.model.test_outcome import compared
from tests.report.samples import METRICS, record

EXAMPLES = int(os.environ.get("SIMBENCH_FUZZ", "25"))

fuzz = settings(
    max_examples=EXAMPLES,
    deadline=None,
    suppress_health_check=list(HealthCheck),
    phases=(Phase.explicit, Phase.reuse, Phase.generate),  # to shrink one takes minutes
)
BENCHMARKS = "benchmarks.json"


@pytest.fixture(autouse=True, scope="module")
def no_pictures() -> Iterator[None]:
    """As where matplotlib is not installed: drawing takes nine tenths of a report's time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "matplotlib", None)
        yield


@cache
def folder() -> Path:
    """A run with everything that a run may hold, and a file of pytest-benchmark."""
    path = Path(tempfile.mkdtemp(prefix="simbench-fuzz-"))
    atexit.register(shutil.rmtree, path)
    run, kept = RunFolder(path), []
    for k in (1, 2, 3):
        notes = Notes(
            log="logs/a.log",
            untested="?",
            filmed=True,
            chosen_on=(Seen(1, 2, task="stacking"),),
            wait=Wait(2.0, 60.0, "support of a", 1e-6, 0.002),
        )
        good = record(repetition=k, metrics={"placed": k / 4, "at_end": 1.0}, notes=notes)
        error = Failure("WorkerHung", "no answer", "pick", "last line")
        bad = replace(good, simulator="drake", status="failed", error=error)
        kept += [good, replace(bad, test="test_stacking[drake-headless]")]
        kept.append(record("drake", k, "throwing", metrics={"moved": 1.0, "landing_x": 1.3}))
    kept.append(replace(record(repetition=4), status="interrupted"))
    for one in kept:
        run.append(one)
    for name, metrics in METRICS.items():
        run.describe(TaskDescription(name, metrics, {metrics[0].name: 0.5}))
    run.ask(Threshold(kept[0].test, "placed", 0.5))
    whole = Claim(kept[0].test, "test_stacking", "mujoco", "headless", "tuned", "FAIL", advice="x")
    placed = replace(whole, task="stacking", metric="placed", relation="at least", threshold=0.9)
    run.claim(whole)
    run.claim(replace(placed, mean=0.5, low=0.4, high=0.6, n=3, crashed=1, advice=""))
    run.claim(replace(placed, simulator="drake", verdict="UNDECIDED", mean=0.9, n=3))
    run.close()
    account = [Carried("mass", "carried", "as compiled"), Carried("tendon", "not carried", "no")]
    keep(path, Path("scene.xml"), account)
    for line in (LINE, REPLAY):
        repeatability.append(path, line)
    write_outcome(path, RunOutcome(False, ("before", compared())))
    figure = Trace.of(scene(), motion(), [(0.0, "pick")])
    figure.write(path, f"traces/{file_stem_of(kept[0])}.npz")
    album = Album()
    album.add("after pick", 1.0, np.zeros((8, 8, 3), np.uint8))
    album.write(path, f"pictures/{file_stem_of(kept[0])}.npz")
    for name in ("a", "b"):
        sample(name, TIMES, [0.2] * 4).save(path, f"{SAMPLES}/{name}.npz")
    described = [TaskDescription(name, metrics) for name, metrics in METRICS.items()]
    saved = {"fullname": "t", "extra_info": {KEY: to_extra_info(kept, described)}}
    (path / BENCHMARKS).write_text(json.dumps({"benchmarks": [saved]}))
    return path


def one_sentence(text: str) -> None:
    assert text
    assert "Traceback" not in text
    assert "\n" not in text.strip()


def report(run: Path) -> None:
    """What `--sim-report` and a comparison do, but for drawing."""
    reading = _read(run)
    outcome, wrong = RunOutcome.read(run)
    told_of = Report.of(reading, outcome)
    found = told_of.records
    written = write_files(run, told_of, figures=False)
    tables, problems = write_tables(run, run)
    _, told = albums(run, found)
    for text in (*reading.problems, *written.problems, *filter(None, [wrong]), *problems, *told):
        one_sentence(text)
    render_tables(tables, 100)
    claim_lines(told_of.claims, 40)
    render_brief(told_of.summaries, 40)
    render_run(told_of.summaries, 100)
    render_histories(told_of.histories, 40)
    sweep_lines(told_of.sweeps, 40, True)
    if outcome.compared is not None:
        render_changes(outcome.compared[1], 100, False)
    for path in (run, run / BENCHMARKS):
        try:
            before = read_baseline(path)
        except BaselineError as error:
            one_sentence(str(error))
        else:
            run_gate(before.records, found, (Limit("placed", 0.05, True),), METRICS)


def _read(run: Path) -> RunContents:
    try:
        return RunFolder(run).read()
    except RecordError as error:
        one_sentence(str(error))
        return RunContents()


def tried(name: str, content: bytes) -> None:
    """The report of the folder with other content in one of its files."""
    with tempfile.TemporaryDirectory() as copy:
        run = Path(copy, "run")
        shutil.copytree(folder(), run, copy_function=os.link)
        (run / name).unlink()
        (run / name).write_bytes(content)
        report(run)


def names() -> list[str]:
    return sorted(str(p.relative_to(folder())) for p in folder().rglob("*") if p.is_file())


TEXTS = (RECORDS, TASKS, THRESHOLDS, CLAIMS, ACCOUNTS, repeatability.NAME, OUTCOME, BENCHMARKS)
ODD = st.sampled_from(
    [None, True, 0, -1, 1e308, -1e-308, 10**20, 10**400, float("nan"), float("inf"), "", "x", "ok",
     "x" * 3000, "a\nb", "\ud800", "../x", "\x1b[2J", [], {}, [[]], [None], {"": {}}, {"a": "b"},
     [1, 2, 3], [[0.1] * 3] * 3],
)  # fmt: skip


def test_the_folder_itself_is_fine() -> None:
    with tempfile.TemporaryDirectory() as copy:
        run = Path(copy, "run")
        shutil.copytree(folder(), run)
        assert len(RunFolder(run).read().records) > 5
        assert RunOutcome.read(run)[1] == ""
        assert len(read_baseline(run / BENCHMARKS).records) > 5
        assert write_tables(run, run)[1] == []
        report(run)
        assert (run / "replay.html").is_file()


@fuzz
@given(st.data())
def test_any_bytes(data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(names()))
    tried(name, data.draw(st.binary(max_size=300)))


@fuzz
@given(st.data())
def test_bytes_that_changed(data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(names()))
    content = bytearray((folder() / name).read_bytes())
    for _ in range(data.draw(st.integers(1, 6))):
        at = data.draw(st.integers(0, max(0, len(content) - 1)))
        length = data.draw(st.sampled_from([0, 1, 1, 1, 7, 200]))
        content[at : at + length] = data.draw(st.binary(max_size=4))
    tried(name, bytes(content))


def places(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where something is in JSON."""
    yield at
    items: Any = ()
    if isinstance(value, dict):
        items = value.items()
    elif isinstance(value, list):
        items = enumerate(value)
    for key, item in items:
        yield from places(item, (*at, key))


def spoil(value: Any, data: st.DataObject) -> Any:
    """JSON with some values replaced by odd ones, doubled, or left out."""
    for _ in range(data.draw(st.integers(1, 3))):
        *way, last = data.draw(st.sampled_from(list(places(value))[1:] or [("x",)]))
        holder = value
        for key in way:
            holder = holder[key]
        kind = data.draw(st.sampled_from(["odd", "odd", "gone", "number", "renamed"]))
        if kind == "odd":
            holder[last] = deepcopy(data.draw(ODD))  # what comes next may spoil it, too
        elif kind == "number":
            holder[last] = data.draw(st.floats() | st.integers())
        elif kind == "gone" or not isinstance(holder, dict):
            del holder[last]
        else:
            holder[data.draw(st.text(max_size=8))] = holder.pop(last)
        if not isinstance(value, dict | list) or not value:
            break
    return value


@fuzz
@given(st.data())
def test_values_of_other_kinds(data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(TEXTS))
    content = (folder() / name).read_text()
    lines = [content] if name.endswith(".json") else content.splitlines()
    at = data.draw(st.integers(0, len(lines) - 1))
    lines[at] = json.dumps(spoil(json.loads(lines[at]), data))
    tried(name, "\n".join([*lines, ""]).encode())


@fuzz
@given(st.data())
def test_arrays_of_other_kinds(data: st.DataObject) -> None:
    """Traces, pictures and motions, and the JSON in them."""
    name = data.draw(st.sampled_from([name for name in names() if name.endswith(".npz")]))
    arrays = dict(np.load(folder() / name))
    for key in data.draw(
        st.lists(st.sampled_from(sorted(arrays)), min_size=1, max_size=2, unique=True)
    ):
        if key in ("about", "facts") and data.draw(st.booleans()):
            text = arrays[key].tobytes() if key == "about" else str(arrays[key])
            told = json.dumps(spoil(json.loads(text), data))
            arrays[key] = np.frombuffer(told.encode(), np.uint8) if key == "about" else told
        else:
            arrays[key] = data.draw(st.sampled_from(ARRAYS))(arrays[key])
    with tempfile.TemporaryFile() as file:
        np.savez(file, **arrays)
        file.seek(0)
        tried(name, file.read())


ARRAYS = (
    lambda a: a[:-1] if np.ndim(a) else a,
    lambda a: np.asarray(a).astype(str),
    lambda a: np.zeros(0),
    lambda a: np.zeros((2, 0, 3)),
    lambda a: np.full(np.shape(a), np.nan),
    lambda a: np.full(np.shape(a), -1),
    lambda a: np.full(np.shape(a), 2**31 - 1),
    lambda a: np.full(np.shape(a), 1e300),
    lambda a: np.zeros((1, *np.shape(a))),
    lambda a: np.array(3 + 2j),
    lambda a: np.full(np.shape(a), "x"),
    lambda a: np.full(np.shape(a), True),
    lambda a: np.zeros(np.shape(a), [("a", float)]),
    lambda a: np.full(np.shape(a), np.datetime64("2020-01-01")),
)
"""What may stand in the place of an array."""
