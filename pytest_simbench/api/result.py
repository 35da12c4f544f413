"""A run and what it says: as text, as HTML in a notebook, as a data frame, as a report."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from os import PathLike
from pathlib import Path
from typing import Any

from pytest_simbench.cli.runs import text_of
from pytest_simbench.cli.values import BadInput, expect, refusing
from pytest_simbench.ground.text import for_terminal
from pytest_simbench.measure.gate import gate_runs
from pytest_simbench.records.baseline import BaselineError, read_baseline
from pytest_simbench.records.folder import RunContents, RunFolder
from pytest_simbench.records.record import RecordError
from pytest_simbench.report.files import columns_of, write_files, write_page
from pytest_simbench.report.model import changes, tables
from pytest_simbench.report.model.document import Section
from pytest_simbench.report.model.outcome import RunOutcome
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.page import PAGE_NAME
from pytest_simbench.report.page.render import fragment
from pytest_simbench.report.terminal.run import render_section

FRAMES = ("pandas", "polars")
"""Packages that make data frames, the first one first."""


@dataclass(frozen=True, repr=False)
class Shown:
    """Something to look at: a text where it is printed, HTML in a notebook."""

    text: str
    html: str

    @classmethod
    def of(cls, sections: Iterable[Section]) -> Shown:
        found, width = list(sections), shutil.get_terminal_size().columns
        text = "\n\n".join(render_section(section, width) for section in found)
        return cls(for_terminal(text), fragment(found))

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        return self.html


class Run:
    """A run: what `run` has made, or `load` has read from its folder.

    Attributes:
        folder: of the run, which `simbench report` and `pytest --sim-baseline` read too.
        contents: its records as objects, and what their numbers mean.
        problems: what is wrong besides crashed repetitions, one sentence each.
    """

    def __init__(self, folder: Path, contents: RunContents, problems: Iterable[str] = ()) -> None:
        self.folder = folder
        self.contents = contents
        self.problems = tuple(dict.fromkeys(filter(None, problems)))

    @cached_property
    def _report(self) -> Report:
        return Report.of(self.contents, RunOutcome.read(self.folder)[0])

    @property
    def records(self) -> Any:
        """A row for each repetition, with the columns of `report.csv`: a data frame of pandas or
        polars, whichever is installed, else a dict of lists."""
        columns = columns_of(self.contents.records)
        package = next(filter(find_spec, FRAMES), None)
        return import_module(package).DataFrame(columns) if package else columns

    def table(self, verbose: bool = False) -> Shown:
        """The result, as pytest prints it; `verbose` with all tables."""
        text = text_of(self._report, shutil.get_terminal_size().columns, verbose)
        found = self._report.sections
        shown = found if verbose else [replace(s, tables=s.tables[:1]) for s in found]
        told = [Section("Problems", self.problems)] if self.problems else []
        return Shown(for_terminal("\n".join([text, *self.problems])), fragment([*shown, *told]))

    def compare(self, earlier: Run | str | Path | None = None) -> Shown:
        """In what the simulators differ; or what has changed since an earlier run, which may be a
        folder, and whether more repetitions crash.

        Raises:
            BadInput: the earlier run cannot be read.
        """
        if earlier is None:
            return Shown.of(map(tables.compared, self._report.tasks))
        expect("earlier", earlier, (Run, str, PathLike), "give a run, or the path of one")
        with refusing(BaselineError):
            before = earlier.contents if isinstance(earlier, Run) else read_baseline(Path(earlier))
        found = changes.section(before.name, gate_runs(before, self.contents))
        notes = dict.fromkeys([*before.problems, *self.problems, *found.notes])
        return Shown.of([replace(found, notes=list(notes))])

    def report(self, path: str | Path | None = None) -> Path:
        """Write the report, and return the path of its page.

        Args:
            path: of a page (`.html`), or of a folder for the page, the replay, Markdown and CSV;
                default: the run's own folder.

        Raises:
            BadInput: it cannot be written.
        """
        if path is not None:
            expect("path", path, (str, PathLike), "give the path of a page or of a folder")
        target = self.folder if path is None else Path(path)
        if target.suffix == ".html":
            problem, page = write_page(target, self._report, self.folder), target
        else:
            written, page = write_files(target, self._report, self.folder), target / PAGE_NAME
            problem = "" if written.complete else "; ".join(written.problems)
        if problem:
            raise BadInput(problem)
        return page

    def __repr__(self) -> str:
        names = dict.fromkeys(record.simulator for record in self.contents.records)
        tasks = dict.fromkeys(record.task for record in self.contents.records)
        many = f"{len(self.contents.records)} repetitions of {', '.join(tasks)}"
        return for_terminal(f"<Run {self.folder}: {many} on {', '.join(names)}>")

    def _repr_html_(self) -> str:
        return self.table().html


def load(folder: str | Path) -> Run:
    """The run in a folder, whoever made it: `run`, pytest, or `simbench merge`.

    Raises:
        BadInput: there is none, or it cannot be read.
    """
    expect("folder", folder, (str, PathLike), "give the path of a run")
    place = RunFolder.of(Path(folder))
    with refusing(RecordError):
        contents = place.read()
    if not contents.records:
        raise BadInput(f"{folder}: it holds no repetition")
    return Run(place.path, contents, contents.problems)
