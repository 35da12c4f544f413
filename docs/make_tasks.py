"""Tables of other arms, of pushing and of real experiments, from docs/data."""

from __future__ import annotations

import json
from dataclasses import asdict
from functools import partial
from statistics import fmean, pstdev

from published_runs import METRICS, TASKS, Run
from tables import NAMES, Kept, Line, numbers, table

from pytest_simbench.data import Impacts
from pytest_simbench.records.record import Record
from pytest_simbench.report.model.pooling import spread
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.tasks import Impacting, Pushing

ROBOTS = {"ur5": "UR5", "ur10": "UR10", "xarm7": "xArm 7", "so101": "SO-101"}
ARM_KEY = ("robot", "task", "profile", "simulator", "changed", "seed")
SHOWN = {
    "stacking": {
        "placed": "placed %", "at_end": "at the end %", "at_end_strict": "strict %",
        "failed_picks": "failed picks",
    },
    "throwing": {
        "hit": "hits", "moved": "moved %", "lost_in_transit": "lost", "landing_x": "landing x",
        "limits": "limits %",
    },
}  # fmt: skip

WAYS = ("line", "curve")
PUSHED = {"position_error": "position mm", "heading_error": "heading deg", "path_error": "path mm"}

SURFACE = ("friction", "restitution")
"""Of impacts: chosen for each simulator."""
REAL = {
    "tossing": ("position_error", "rotation_error"),
    "impacting": ("velocity_error", "relative_error", *SURFACE),
    "arm_pushing": ("displacement", "displacement_error", "turn_error", "way_error"),
    "arm_following": ("hand_error", "rest_error", "displacement"),
    "arm_following_corrected": ("hand_error", "rest_error", "displacement"),
}
"""Metrics of real experiments; the cube's displacement is a detail of those that follow commands.
"""
FOLLOWING = ("arm_following", "arm_following_corrected")
PROFILES = ("default", "tuned", "real")


def _of_arm(record: Record) -> dict[str, object] | None:
    """With the settings that are not the profile's."""
    if record.task not in SHOWN or record.robot.get("name") not in ROBOTS:
        return None
    profile = json.loads(json.dumps(asdict(adapter(record.simulator).profiles[record.profile])))
    now = record.settings
    changed = [f"{name}={now[name]}" for name, value in profile.items() if now[name] != value]
    return {"robot": record.robot["name"], "changed": " ".join(changed), **record.metrics}


def _of_push(record: Record) -> dict[str, object] | None:
    if "task.turn" not in record.settings:
        return None
    way = WAYS[bool(record.settings["task.turn"])]
    return {"robot": record.robot.get("name", "panda"), "way": way, **record.metrics}


def _of_experiment(task: str, record: Record) -> dict[str, object] | None:
    if record.task != task:
        return None
    number = str(record.notes.sample[1]) if record.notes.sample else ""
    if task in FOLLOWING:
        number = record.details.get("run", number)
    chosen = {name: record.settings.get(f"task.{name}") for name in SURFACE}
    return {**record.details, **record.metrics, **chosen, "number": number}


ARMS = Kept(
    "arms",
    ARM_KEY,
    (*ARM_KEY, "version", "status",
     *dict.fromkeys(m.name for task in TASKS.values() for m in task.metrics)),
    _of_arm,
)  # fmt: skip
PUSHING = Kept(
    "pushing",
    ("robot", "profile", "simulator", "way", "seed"),
    ("robot", "profile", "simulator", "version", "way", "seed", "status",
     *(metric.name for metric in Pushing().metrics)),
    _of_push,
)  # fmt: skip
EXPERIMENTS = {
    task: Kept(
        task,
        ("profile", "simulator", "number"),
        ("profile", "simulator", "version", "number", "status", *metrics),
        partial(_of_experiment, task),
    )
    for task, metrics in REAL.items()
}
KEPT = (ARMS, PUSHING, *EXPERIMENTS.values())


def arms(task: str) -> str:
    """A row for each arm, simulator and change of settings: mean and 95 % interval."""
    runs: dict[tuple[int, int, str], Run] = {}
    for line in ARMS.lines(task=task):
        key = (list(ROBOTS).index(line["robot"]), list(NAMES).index(line["simulator"]))
        runs.setdefault((*key, line["changed"]), Run(task, [])).lines.append(line)
    rows = []
    for (robot, simulator, changed), run in sorted(runs.items()):
        name = [list(NAMES.values())[simulator], *(f"`{change}`" for change in changed.split())]
        cells = [_with_interval(run, metric) for metric in SHOWN[task]]
        rows.append([list(ROBOTS.values())[robot], " ".join(name), run.repetitions, *cells])
    return table(("arm", "simulator", "repetitions", *SHOWN[task].values()), rows, 2)


def _with_interval(run: Run, name: str) -> str:
    if METRICS[run.task][name].kind != "value":
        return run.cell(name)
    mean = run.mean(name)
    return "-" if mean is None else f"{mean:.{3 if abs(mean) < 10 else 0}f}"


def _largest(lines: list[Line], metric: str) -> str:
    """The mean, and in brackets the largest; lengths in mm."""
    turn = metric in ("heading_error", "turn_error")
    values = numbers(lines, metric, 1.0 if turn else 1000.0)
    digits = 2 if metric == "heading_error" else 1
    return f"{fmean(values):.{digits}f} [{max(values):.{digits}f}]" if values else "-"


def pushing(robot: str, profile: str) -> str:
    """Each error on a line and round a curve."""
    lines = PUSHING.lines(robot=robot, profile=profile)
    rows = []
    for simulator, name in NAMES.items():
        of = [line for line in lines if line["simulator"] == simulator]
        ways = [[line for line in of if line["way"] == way] for way in WAYS]
        tipped = sum(numbers(of, "tipped"))
        errors = [_largest(found, metric) for found in ways for metric in PUSHED]
        if of:
            rows.append([name, *errors, f"{tipped:g} of {len(of)}"])
    heads = [f"{way}: {error}" for way in WAYS for error in PUSHED.values()]
    return table(("simulator", *heads, "tipped"), rows)


def tossing() -> str:
    """Mean and standard deviation over the tosses."""
    rows = []
    for simulator, name in NAMES.items():
        cells = []
        for profile in PROFILES:
            lines = EXPERIMENTS["tossing"].lines(simulator=simulator, profile=profile)
            for values in (numbers(lines, metric) for metric in REAL["tossing"]):
                cells.append(f"{fmean(values):.1f} ± {pstdev(values):.1f}" if values else "-")
        if set(cells) != {"-"}:
            rows.append([name, *cells])
    errors = ("position %", "rotation deg")
    heads = [f"{profile}: {error}" for profile in PROFILES for error in errors]
    return table(("simulator", *heads), rows)


def impacting() -> str:
    """What was chosen for each simulator, and mean and 95 % interval over the impacts. Then laws of
    impacts without an engine, on the same impacts (docs/reality.md)."""
    metric = Impacting(Impacts(())).metrics[0]
    rows = []
    for simulator, name in NAMES.items():
        lines = EXPERIMENTS["impacting"].lines(simulator=simulator, profile="real")
        found = spread(numbers(lines, metric.name), metric)
        if found:
            error = f"{found.mean:.3f} [{found.low:.3f}, {found.high:.3f}]"
            relative = f"{fmean(numbers(lines, 'relative_error')):.0f}"
            rows.append([name, *(lines[0][key] for key in SURFACE), error, relative])
    rows += [[*line.values()] for line in Kept("impact_laws", (), (), lambda record: None).lines()]
    return table(("simulator", *SURFACE, "velocity error m/s", "relative error %"), rows)


def arm_pushing() -> str:
    """Means, and in brackets the largest."""
    rows = []
    for simulator, name in NAMES.items():
        for profile in PROFILES:
            lines = EXPERIMENTS["arm_pushing"].lines(simulator=simulator, profile=profile)
            if numbers(lines, "displacement"):
                cells = [_largest(lines, metric) for metric in REAL["arm_pushing"]]
                rows.append([name, profile, *cells])
    heads = ("displacement mm", "its error mm", "turn's error deg", "way's error mm")
    return table(("simulator", "profile", *heads), rows, 2)


HEADS = ("free motion mm", "push mm", "cube moved mm")


def arm_following() -> str:
    """Means over the runs of each experiment, commands as given and corrected."""
    rows = []
    for simulator, name in NAMES.items():
        cells = []
        for task in FOLLOWING:
            lines = EXPERIMENTS[task].lines(simulator=simulator, profile="real")
            free = [line for line in lines if line["number"].startswith("Single")]
            push = [line for line in lines if line["number"].startswith("CubeExp")]
            for part, metric in (
                (free, "hand_error"), (push, "hand_error"), (push, "displacement")
            ):  # fmt: skip
                values = numbers(part, metric, 1000.0)
                cells.append(f"{fmean(values):.1f}" if values else "-")
        if set(cells) != {"-"}:
            rows.append([name, str(len(lines)), *cells])
    both = [f"{how}: {head}" for how in ("given", "corrected") for head in HEADS]
    return table(("simulator", "runs", *both), rows)


def source_simulations() -> str:
    """The source's own simulations (`benchmarks/source_simulations.py` of commit 6084227)."""
    cells: dict[str, list[str]] = {}
    for line in Kept("source_simulations", (), (), lambda record: None).lines():
        free = line["experiment"] == "Single"
        for metric in ("hand_error",) if free else ("hand_error", "displacement"):
            told = f"{1000 * float(line[metric]):.1f}" if line[metric] else "diverged"
            cells.setdefault(line["simulator"], []).append(told)
    return table(("the source's", *HEADS), [[name, *row] for name, row in cells.items()])
