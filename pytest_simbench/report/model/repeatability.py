"""What a run folder holds on repeatability: replay, small perturbations, agreement."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pytest_simbench.records.metrics import significant
from pytest_simbench.records.repeatability import GROWTH_TIMES, Again, Line, read
from pytest_simbench.records.series import short
from pytest_simbench.repeatability.agreement import LIMITS, Agreement, agreements
from pytest_simbench.report.model.document import Column, Table

REPLAY = (
    "The same seed and commands again. same: every sampled bit, 50 times a second and at the end "
    "of each motion; else the simulated time of the first difference"
)
GROWTH = "How fast they part: largest distance of a cube from itself, so long after the first bit"
PERTURBATION = (
    "The smallest perturbation found that changes the outcome, what random ones up to a bound "
    "leave of it, and how a displacement grows under the same commands"
)
AGREEMENT = (
    "When the cubes of two simulators first differ by 1 mm / 1 cm, for the same seed; never: not "
    "while both episodes lasted"
)


def found_in(folder: Path) -> tuple[list[Table], list[str]]:
    """The tables, and one sentence for each thing that is wrong."""
    try:
        found = read(folder)
        return tables(found.items, agreements(folder)), [*found.problems, *found.refused]
    except ValueError as error:
        return [], [str(error)]


def tables(lines: Sequence[Line], agreements: Sequence[Agreement]) -> list[Table]:
    """All tables that there is something to tell in."""
    replays = [line for line in lines if line.kind == "replay"]
    found: list[Table] = []
    for task, seed in dict.fromkeys((line.task, line.seed) for line in replays):
        ours = [line for line in replays if (line.task, line.seed) == (task, seed)]
        title, names = f"Replay: {task}, seed {seed}", _names(ours)
        found.append(Table(title, replay_columns(ours, names), REPLAY))
        parted = [
            (f"{name}, {again.way}", again)
            for line, name in zip(ours, names, strict=True)
            for again in line.again
            if again.first is not None
        ]
        if parted:
            found.append(Table(f"{title}, growth", growth_columns(parted), GROWTH))
    others = [line for line in lines if line.kind != "replay"]
    if others:
        found.append(Table("Perturbation", sentence_columns(others), PERTURBATION))
    for what in dict.fromkeys(pair.what for pair in agreements):
        same = [pair for pair in agreements if pair.what == what]
        title = f"Agreement: {what[0]}"
        found.append(Table(title, matrix_columns(same), AGREEMENT))
        found.append(Table(f"{title}, in detail", detail_columns(same)))
    return found


def _names(lines: Sequence[Line]) -> list[str]:
    """The label of each; with its test where several tests have that label."""
    labels = [line.label for line in lines]
    return [
        label if labels.count(label) == 1 else f"{label}, {short(line.test)}"
        for label, line in zip(labels, lines, strict=True)
    ]


def replay_columns(lines: Sequence[Line], names: Sequence[str]) -> list[Column]:
    """A row for each simulator, a column for each way of running again."""
    told = [{again.way: again for again in line.again} for line in lines]
    claims = ["yes" if line.result["claims"] else "no" for line in lines]
    return [
        Column("simulator", names, left=True),
        Column("claims to repeat", claims),
        *(
            Column(way, [_cell(found[way]) if way in found else "" for found in told])
            for way in dict.fromkeys(way for found in told for way in found)
        ),
    ]


def _cell(again: Again) -> str:
    if again.failure:
        return "failed"
    if again.skipped:
        return "not run"
    return "same" if again.first is None else f"{again.first:.2f} s"


def growth_columns(parted: Sequence[tuple[str, Again]]) -> list[Column]:
    """A row for each way in which a simulator did not repeat itself."""
    agains = [again for _, again in parted]

    def gap(size: float | None) -> str:
        return "" if size is None else significant(1000 * size)

    return [
        Column("simulator", [name for name, _ in parted], left=True),
        Column("first at s", [f"{again.first:.2f}" for again in agains]),
        Column("cube", [again.body or "(robot)" for again in agains], left=True),
        *(
            Column(f"mm at {after} s", [gap((a.growth or {}).get(after)) for a in agains])
            for after in GROWTH_TIMES
        ),
        Column("mm at most", [gap(again.largest) for again in agains]),
        Column("outcome", [_outcome(again) for again in agains], left=True),
    ]


def _outcome(again: Again) -> str:
    return f"changed: {', '.join(again.changed)}" if again.changed else "the same"


def sentence_columns(lines: Sequence[Line]) -> list[Column]:
    """A sentence for each result."""
    kinds = {"search": "smallest", "stability": "random", "sensitivity": "growth"}
    return [
        Column("simulator", [line.label for line in lines], left=True),
        Column("task", [line.task for line in lines], left=True),
        Column("what", [kinds.get(line.kind, line.kind) for line in lines], left=True),
        Column("result", [line.result["sentence"] for line in lines], left=True, wrap=True),
    ]


def matrix_columns(agreements: Sequence[Agreement]) -> list[Column]:
    """Simulators against simulators."""
    names = list(dict.fromkeys(n for a in agreements for n in (a.first, a.second)))
    pairs: dict[tuple[str, str], Agreement] = {}
    for found in agreements:
        pairs[found.first, found.second] = pairs[found.second, found.first] = found
    return [
        Column("", names, left=True),
        *(
            Column(other, ["-" if name == other else _pair(pairs.get((name, other)))
                           for name in names])
            for other in names
        ),
    ]  # fmt: skip


def _pair(found: Agreement | None) -> str:
    if found is None:
        return ""
    times = [found.partings[limit] for limit in LIMITS]
    return " / ".join("never" if time is None else f"{time.time:.2f} s" for time in times)


def detail_columns(agreements: Sequence[Agreement]) -> list[Column]:
    """A row for each pair: when, which cube, and where in the world."""

    def parting(found: Agreement, limit: float) -> str:
        known = found.partings[limit]
        return f"never in {found.until:.1f} s" if known is None else str(known)

    def commands(time: float | None) -> str:
        return "never" if time is None else f"{time:.2f} s"

    near, far = ([parting(a, limit) for a in agreements] for limit in LIMITS)
    outcomes = ["the same" if a.same_outcome else "differs" for a in agreements]
    return [
        Column("pair", [f"{a.first} and {a.second}" for a in agreements], left=True, wrap=True),
        Column("1 mm", near, left=True, wrap=True),
        Column("1 cm", far, left=True, wrap=True),
        Column("commands part", [commands(a.commands_part) for a in agreements], left=True),
        Column("outcome", outcomes, left=True),
    ]
