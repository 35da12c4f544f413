"""`simbench watch`: which releases are new, and what each of them changed.

The releases after the one that was seen last run side by side with it. Each part is a pytest run in
a folder of its own, as those of `simbench bisect`: an interrupted watch goes on where it was.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import date
from itertools import pairwise
from pathlib import Path

from pytest_simbench import __version__
from pytest_simbench.cli.main import BAD_INPUT
from pytest_simbench.cli.runs import RUNS
from pytest_simbench.cli.search import Search
from pytest_simbench.cli.values import BadInput, refusing
from pytest_simbench.client.package_index import newest_of_minors, releases, unreleased
from pytest_simbench.experiment.scene_file import URDF
from pytest_simbench.experiment.variants import USUAL
from pytest_simbench.ground.errors import SimulatorError
from pytest_simbench.ground.files import FileError, read_file, read_json
from pytest_simbench.ground.host import host
from pytest_simbench.ground.names import digest, file_name
from pytest_simbench.ground.text import for_terminal
from pytest_simbench.ground.versions import RELEASE, VersionedName, base_name, release_numbers
from pytest_simbench.measure.limits import Limit, LimitError, parse_limits
from pytest_simbench.measure.watching import Step, of_laws, of_scene, of_tasks
from pytest_simbench.records import checked
from pytest_simbench.records.folder import RunContents, RunFolder
from pytest_simbench.records.metrics import UnknownMetric
from pytest_simbench.records.paths import write_whole
from pytest_simbench.records.record import RecordError
from pytest_simbench.report.files import shown
from pytest_simbench.report.markdown.github import append_summary
from pytest_simbench.report.markdown.run import render_section
from pytest_simbench.report.model.watched import section
from pytest_simbench.report.page import PAGE_NAME
from pytest_simbench.report.page.render import render_watch
from pytest_simbench.simulator.registry import adapter, check_names, known, problem
from pytest_simbench.tasks import Stacking, Throwing

STATE, SCHEMA, LARGEST = "watch.json", 1, 64 * 2**20
"""The file of what was seen, its form, and how large it may be [bytes]."""

MINOR = ":minor"
"""Behind a release to begin with: of each minor version after it the last release alone."""

PAGES = ("index.html", "index.md")

TASKS = (Stacking(), Throwing())
REPETITIONS = 12
LIMITS = "placed:5%,hit:20%,cpu_cost:20%"

SUITES = "pytest_simbench.suites.test_"
LAWS_RUN = ("--pyargs", f"{SUITES}physics")
TASKS_RUN = ("--pyargs", f"{SUITES}stacking", f"{SUITES}throwing", "--protocol=smoke")
SCENE_RUN = ("--pyargs", f"{SUITES}scene")


@dataclass(frozen=True)
class State:
    """What the watches in a folder saw.

    Attributes:
        seen: the newest release of each simulator that was judged, or noted at first.
        steps: the verdicts, oldest first.
        schema: of the file.
    """

    seen: dict[str, str] = field(default_factory=dict)
    steps: list[Step] = field(default_factory=list)
    schema: int = SCHEMA

    @classmethod
    def read(cls, path: Path) -> State:
        """What a file says; nothing was seen where there is none.

        Raises:
            BadInput: it is none of ours.
        """
        if not path.exists():
            return cls()
        try:
            data = checked.plain(read_json(read_file(path, LARGEST, "what was seen,")))
            checked.schema(data, SCHEMA)
            return checked.convert(data, cls)
        except (FileError, ValueError) as error:
            raise BadInput(f"{path}: {error}; remove it to begin anew") from None

    def take(self, steps: Sequence[Step]) -> None:
        """Add the steps of one simulator, in place of earlier ones of the same releases."""
        again = {step.names for step in steps}
        self.steps[:] = [*(step for step in self.steps if step.names not in again), *steps]
        self.seen.update({step.engine: step.new for step in steps})

    def write(self, folder: Path, sentences: Sequence[str]) -> str:
        """Write it and its page; the same as Markdown.

        Raises:
            BadInput: the folder cannot be written to.
        """
        text = render_section(section(self.steps, sentences), 1) + "\n"
        contents = json.dumps(asdict(self), indent=1), render_watch(self.steps, sentences), text
        with refusing(OSError, str(folder)):
            for name, content in zip((STATE, *PAGES), contents, strict=True):
                write_whole(folder, name, content.encode("utf-8", "replace"))
        return text


def watch(
    engines: Sequence[str],
    since: Sequence[str] | None = None,
    scene: Sequence[str] | None = None,
    reps: int | None = None,
    limit: str | None = None,
    output: str | None = None,
) -> int:
    """Judge what is new, write the page, and return the exit code: 1 where a release changed
    something, else 2 where something could not be judged.

    Raises:
        BadInput, SimulatorError: what cannot be; one sentence.
    """
    begins = dict[str, str]()
    for text in since or ():
        if RELEASE not in text:
            raise BadInput(f"--since {text}: write it as NAME==RELEASE or NAME==RELEASE{MINOR}")
        name = VersionedName.of(text.removesuffix(MINOR)).base
        if begins.setdefault(name, text) != text:
            raise BadInput(f"--since {text}: {begins[name]} says already where {name} begins")
    names = _names([*dict.fromkeys([*engines, *begins])])
    with refusing((LimitError, UnknownMetric), "--limit"):
        limits = parse_limits(limit or LIMITS, [m for task in TASKS for m in task.metrics])
    for path in scene or ():
        if not Path(path).is_file():
            raise BadInput(f"--scene {path}: there is no such file; give an MJCF or a URDF file")
    folder = Path(output) if output else Path(RUNS, "watch")
    state, plans = State.read(folder / STATE), dict[str, list[str]]()
    told, failed, steps = list[str](), list[str](), list[Step]()
    for name in names:
        try:
            first, *new = plans[name] = _plan(name, begins.get(name, ""), state.seen.get(name, ""))
        except SimulatorError as error:
            failed.append(f"{name} could not be judged: {error}")
            continue
        what = f"after {first} came {', '.join(new)}" if new else f"nothing came after {first}"
        earlier = "" if name in state.seen or new else f"; --since {name}==RELEASE begins earlier"
        told.append(f"{name}: {what}{earlier}")
        state.seen.setdefault(name, first)
    print(for_terminal("\n".join([*told, *failed])), flush=True)
    for name, plan in plans.items():
        try:
            run = Runs(name, plan, folder, reps or REPETITIONS, [*map(Path, scene or ())])
            judged = run.judged(limits, sum(map(len, plans.values())) - len(plans))
        except (BadInput, RecordError) as error:
            failed.append(f"{name} could not be judged: {error}")
            print(for_terminal(failed[-1]), flush=True)
            continue
        steps += judged
        state.take(judged)
        state.write(folder, [*told, *failed])
    for step in steps:
        lines = [*step.changed, *(f"({text})" for text in step.told)] or ["no change"]
        print(for_terminal("\n  ".join([f"{step.engine} {step.new}, after {step.old}", *lines])))
    unsaid = append_summary(state.write(folder, [*told, *failed]))
    print(for_terminal(unsaid or f"page: {shown(folder / PAGES[0], Path.cwd())}"))
    return 1 if any(step.changed for step in steps) else BAD_INPUT if failed else 0


@dataclass(frozen=True)
class Runs:
    """What is run on releases of one simulator, the oldest first.

    Attributes:
        engine, releases: the simulator and its releases.
        folder: of the watch.
        repetitions: of the tasks.
        scenes: files.
    """

    engine: str
    releases: Sequence[str]
    folder: Path
    repetitions: int
    scenes: Sequence[Path]

    def judged(self, limits: Sequence[Limit], steps: int) -> list[Step]:
        """Each release against the one before it; `steps` are those of all simulators.

        Raises:
            BadInput: a run ends with an error.
            RecordError: its records cannot be read.
        """
        if len(self.releases) < 2:
            return []
        tuned = f"--sim-profile={USUAL}"
        repeated = f"--reps={self.repetitions}"
        laws, laws_at = self._run("laws", *LAWS_RUN, tuned)
        tasks, tasks_at = self._run("tasks", *TASKS_RUN, tuned, repeated)
        reports, scenes = {"laws": laws_at, "tasks": tasks_at}, dict[str, RunContents]()
        for path in self.scenes:
            own = "file" in adapter(self.engine).profiles and path.suffix.lower() != URDF
            words = f"--sim-scene={path}", "--sim-profile=file" if own else tuned
            part = file_name(path.stem, path.read_bytes())
            scenes[str(path)], reports[str(path)] = self._run(part, *SCENE_RUN, *words)
        found = []
        for old, new in pairwise(self.releases):
            step = Step(self.engine, old, new, reports=reports, day=date.today().isoformat())
            told = [*of_laws(step, laws.records), *of_tasks(step, tasks, limits, steps)]
            for name, run in scenes.items():
                told += of_scene(step, name, run.records)
            changed = [text for certain, text in told if certain]
            rest = [text for certain, text in told if not certain]
            found.append(replace(step, changed=changed, told=rest))
        return found

    def _run(self, part: str, *words: str) -> tuple[RunContents, str]:
        """What the run of these tests gives, and the address of its page."""
        same = json.dumps([__version__, host(), self.repetitions], sort_keys=True)
        at = f"{self.engine}-{self.releases[0]}-{self.releases[-1]}-{digest(same)}/{part}"
        print(f"{self.engine}: {part} of {len(self.releases)} releases", flush=True)
        search = Search(self.engine, "", self.releases, self.folder / at, words)
        search.run(*range(len(self.releases)))
        return RunFolder(search.folder).read(), f"{at}/{PAGE_NAME}"


def _names(asked: Sequence[str]) -> list[str]:
    """Simulators whose releases an index has: those asked for, or all.

    Raises:
        BadInput, SimulatorError: one is unknown, or has no index; with the valid choices.
    """
    infos = {name: adapter(name).info for name in known() if not problem(name)}
    usable = [n for n, info in infos.items() if not (info.system_packages or info.program[0])]
    for name in asked:
        check_names([name])
        if name not in usable:
            told = problem(name) or "no package index has its releases"
            if name != base_name(name):
                told = f"name the simulator alone; --since {name} begins after a release"
            raise BadInput(f"{name}: {told}; choose from {', '.join(usable)}")
    return list(asked) or usable


def _plan(name: str, since: str, seen: str) -> list[str]:
    """The release to compare with, and those after it; the newest alone where none was seen.

    Raises:
        SimulatorError: no index answers.
        BadInput: there is no such release.
    """
    info = adapter(name).info
    found = [v for v in releases(info.distribution) if not info.refused(v)]
    if not found:
        raise SimulatorError(f"its adapter runs with no release of {info.distribution}")
    first = VersionedName.of(since.removesuffix(MINOR)).which or seen or found[-1]
    if since and first not in found:
        told = info.refused(first) or unreleased(info.distribution, first, found)
        raise BadInput(f"--since {since}: {told or 'write it in full'}")
    if first not in found:  # it was taken back
        older = [v for v in found if release_numbers(v) < release_numbers(first)]
        first = older[-1] if older else found[0]
    newer = found[found.index(first) + 1 :]
    return [first, *(newest_of_minors(newer) if since.endswith(MINOR) else newer)]
