"""Tables and pages of stackings and throws, from stacking.csv and throwing.csv."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from published_runs import METRICS, PARTS, PROFILES, REPETITIONS, RULES, SETTINGS, TASKS, Run, Runs
from published_runs import load as load_runs
from tables import DOCS, SIMULATORS, table

from pytest_simbench.measure.comparison import compare_by_seed, holm
from pytest_simbench.report.figures.drawing import write
from pytest_simbench.report.figures.task import pictures
from pytest_simbench.report.markdown import run as markdown
from pytest_simbench.report.model import cells
from pytest_simbench.report.model.summary import TaskSummary, summarise
from pytest_simbench.tasks import Throwing

PLURALS = {"stacking": "stackings", "throwing": "throws"}
WORDS = {"ours": "our rules", "study": "the study's rules"}


def number(value: float | None, digits: str = ".3f") -> str:
    return "-" if value is None else f"{value:{digits}}".replace("-0.0", "0.0")


def cost(run: Run | None, name: str = "cpu_cost") -> str:
    found = run.mean(name) if run else None
    return "-" if found is None else cells.number(found, 2)


def peak(*runs: Run | None) -> str:
    """Of the memory [MB], over the repetitions that ended well."""
    found = [value for run in runs if run for value in run.values("ram_peak").values()]
    return f"{max(found):.0f}" if found else "-"


def page_link(simulator: str) -> str:
    return f"[{SIMULATORS[simulator]}](engines/{simulator}.md)"


def overview(runs: Runs) -> str:
    """README: our rules, tuned settings."""
    rows = []
    for simulator, name in SIMULATORS.items():
        stack, throw = (runs.get(("ours", "tuned", task, simulator)) for task in TASKS)
        if not (stack or throw):
            continue
        rows.append([
            name,
            number(stack.mean("placed", 100) if stack else None, ".0f"),
            stack.cell("at_end") if stack else "-",
            number(stack.mean("at_end_strict", 100) if stack else None, ".0f"),
            *(throw.cell(metric) if throw else "-" for metric in ("hit", "moved")),
            landing(throw)[0] if throw else "-",
            f"{cost(stack)}, {cost(throw)}",
            peak(stack, throw),
        ])  # fmt: skip
    headings = ("simulator", "placed %", "at the end %", "strict %", "throws that hit", "moved %",
                "landing x", "CPU s per s", "RAM MB")  # fmt: skip
    return "\n\n".join(filter(None, (table(headings, rows), missing(runs))))


def missing(runs: Runs) -> str:
    """What the README's table lacks, as a sentence; nothing where it lacks nothing."""
    lacking: dict[str, list[str]] = {}
    for simulator, name in SIMULATORS.items():
        done = {task: runs.get(("ours", "tuned", task, simulator)) for task in TASKS}
        few = [
            f"{len(run.lines) if run else 'no'} {PLURALS[task]}"
            for task, run in done.items()
            if not run or len(run.lines) < REPETITIONS
        ]
        if few:
            none = few == [f"no {word}" for word in PLURALS.values()]
            lacking.setdefault("" if none else f" ({', '.join(few)})", []).append(name)
    if not lacking:
        return ""
    names = "; ".join(_listed(names) + few for few, names in lacking.items())
    return f"Not measured again yet: {names}."


def _listed(names: Sequence[str]) -> str:
    """A, B and C."""
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


STACKING = ("placed", "at_end", "placed_strict", "at_end_strict", "failed_picks", "untouched_moved")


def stacking(runs: Runs, rules: str, profile: str) -> str:
    """docs/results.md: stackings of one setting."""
    rows = [
        [page_link(simulator), run.repetitions, *map(run.cell, STACKING), cost(run),
         peak(run)]
        for simulator, run in _of(runs, rules, profile, "stacking")
    ]  # fmt: skip
    headings = ("simulator", "stackings", "placed %", "at the end %", "placed, strict %",
                "at the end, strict %", "failed picks", "untouched moved", "CPU s per simulated s",
                "peak RAM MB")  # fmt: skip
    return table(headings, rows) if rows else NOTHING


def throwing(runs: Runs, rules: str, profile: str) -> str:
    """docs/results.md: throws of one setting."""
    rows = [
        [page_link(simulator), run.repetitions, run.cell("hit"), run.cell("moved"),
         run.cell("lost_in_transit"), *landing(run), limits(run), cost(run)]
        for simulator, run in _of(runs, rules, profile, "throwing")
    ]  # fmt: skip
    headings = ("simulator", "throws", "hits", "moved %", "lost in transit",
                "landing x, from the release", "off by mm", "the flight adds mm", "late by ms",
                "limits %: velocity, acceleration, torque", "CPU s per simulated s")  # fmt: skip
    return table(headings, rows) if rows else NOTHING


NOTHING = "Not run yet."


def landing(run: Run) -> tuple[str, str, str, str]:
    """Where it lands, how far from a perfect follower's place, what the flight adds, how late."""
    if (run.mean("lost_in_transit") or 0) > 0:
        return ("lost", "-", "-", "-")
    x, flown = run.values("landing_x"), run.values("flight_x")
    added = [1000 * (flown[seed] - x[seed]) for seed in x if seed in flown]
    task = TASKS["throwing"] if run.lines[0]["rules"] == "ours" else Throwing().study()
    off = 1000 * (statistics.fmean(x.values()) - task.references["landing_x"])
    late = run.mean("release_time_error", 1000)
    return (
        number(run.mean("landing_x")),
        number(off, "+.1f"),
        number(statistics.fmean(added), "+.1f"),
        number(late, ".1f"),
    )


def limits(run: Run) -> str:
    return ", ".join(number(run.mean(name), ".0f") for name in PARTS["throwing"][1:])


def engine(runs: Runs, simulator: str) -> str:
    """An engine's page: all settings, seeds and all."""
    parts = []
    for task, headings, metrics in (
        ("stacking", ("placed %", "at the end %", "at the end, strict %", "failed picks"),
         ("placed", "at_end", "at_end_strict", "failed_picks")),
        ("throwing", ("hits", "moved %"), ("hit", "moved")),
    ):  # fmt: skip
        rows = []
        for rules, profile in SETTINGS:
            run = runs.get((rules, profile, task, simulator))
            if run:
                more = (*landing(run)[:3], limits(run)) if task == "throwing" else ()
                row = [WORDS[rules], f"`{profile}`", run.repetitions, *map(run.cell, metrics)]
                rows.append([*row, *more, cost(run)])
        more = ("landing x", "off by mm", "the flight adds mm", "limits %")
        last = (*(more if task == "throwing" else ()), "CPU s per simulated s")
        if rows:
            parts.append(table((task, "settings", "repetitions", *headings, *last), rows, 2))
    return "\n\n".join(parts) or "This engine was not run again on the new seeds yet."


def against_study(runs: Runs, task: str, metrics: Sequence[str]) -> str:
    """docs/study.md: ours and the study's rules on the same seeds, and what differs for certain."""
    pairs = [
        (profile, simulator, run, runs["study", profile, task, simulator])
        for (rules, profile, at, simulator), run in runs.items()
        if (rules, at) == ("ours", task) and ("study", profile, task, simulator) in runs
    ]
    tested = [
        [_p_value(ours.values(name), study.values(name)) for name in metrics]
        for *_, ours, study in pairs
    ]
    corrected = iter(holm([p for row in tested for p in row]))
    rows = []
    for profile, simulator, ours, study in pairs:
        apart = "; " if "failed" in ours.repetitions + study.repetitions else ", "
        repetitions = apart.join((ours.repetitions, study.repetitions))
        row = [f"{SIMULATORS[simulator]} `{profile}`", repetitions]
        for name in metrics:
            metric = METRICS[task][name]
            means = [run.mean(name) for run in (ours, study)]
            texts = ["-" if mean is None else cells.metric_value(mean, metric) for mean in means]
            sure = next(corrected) <= 0.05 and texts[0] != texts[1]
            text = texts[0] if texts[0] == texts[1] else " → ".join(texts)
            row.append(f"**{text}**" if sure else text)
        rows.append(row)
    return table(("simulator", "repetitions", *titles(task, metrics)), rows)


def _p_value(ours: Mapping[int, float], study: Mapping[int, float]) -> float:
    """Of a difference; 1 where one side has no value."""
    return compare_by_seed(ours, study).p_value if ours and study else 1.0


def single_rules(runs: Runs, task: str, metrics: Sequence[str]) -> str:
    """docs/study.md: one rule of the study at a time."""
    rows = [
        [f"{SIMULATORS[simulator]} `{profile}`", RULES[rules], *map(run.cell, metrics)]
        for profile in PROFILES
        for simulator in SIMULATORS
        for (rules, *rest), run in runs.items()
        if rest == [profile, task, simulator] and _single(runs, profile, task, simulator)
    ]
    return table(("simulator", "rules", *titles(task, metrics)), rows, 2) if rows else NOTHING


def titles(task: str, metrics: Sequence[str]) -> list[str]:
    found = [METRICS[task][name] for name in metrics]
    return [f"{m.title} %" if m.bounded or m.unit == "%" else m.title for m in found]


def _single(runs: Runs, *rest: str) -> bool:
    return any((rules, *rest) in runs for rules in RULES if rules not in WORDS)


def _of(runs: Runs, rules: str, profile: str, task: str) -> list[tuple[str, Run]]:
    found = ((name, runs.get((rules, profile, task, name))) for name in SIMULATORS)
    return [(name, run) for name, run in found if run]


def raw_links(runs: Runs) -> str:
    """docs/results.md: the pages of `raw` that there are."""
    rows = []
    for rules, words in WORDS.items():
        found = [
            [
                f"[{task}](data/{rules}_{profile}_{task}.md)"
                for task in TASKS
                if _of(runs, rules, profile, task)
            ]
            for profile in PROFILES
        ]
        rows.append([words, *(", ".join(links) or "not run yet" for links in found)])
    return table(("all numbers, who beats whom", "tuned", "default"), rows, 3)


TABLES: dict[str, Callable[[Runs], str]] = {
    "overview": overview,
    "raw": raw_links,
    **{
        f"{rules} {profile} {task}": lambda runs, r=rules, p=profile, make=make: make(runs, r, p)
        for rules, profile in SETTINGS
        for task, make in (("stacking", stacking), ("throwing", throwing))
    },
    **{
        f"engine {simulator}": lambda runs, name=simulator: engine(runs, name)
        for simulator in SIMULATORS
    },
    "study stacking": lambda runs: against_study(runs, "stacking", STACKING),
    "study throwing": lambda runs: against_study(
        runs, "throwing", ("hit", "moved", "moved_otherwise", "lost_in_transit", "limits")
    ),
    "rules stacking": lambda runs: single_rules(runs, "stacking", STACKING[:5]),
    "rules throwing": lambda runs: single_rules(
        runs, "throwing", ("hit", "moved", "moved_otherwise", "landing_x", "limits")
    ),
}

load = cache(load_runs)


def _summary(rules: str, profile: str, task: str) -> TaskSummary:
    records = [r for _, run in _of(load(), rules, profile, task) for r in run.records()]
    whole = TASKS[task].study() if rules == "study" else TASKS[task]
    return summarise(records, {task: whole.metrics}, {task: whole.references})[0]


def raw(rules: str, profile: str, task: str) -> str:
    """A page with all numbers of one setting, and who beats whom."""
    found = [line for _, run in _of(load(), rules, profile, task) for line in run.lines]
    seeds = sorted({int(line["seed"]) for line in found})
    commits = ", ".join(sorted({line["commit"] for line in found}))
    text = markdown.render_task(_summary(rules, profile, task), 1).split("\n", 1)[1].strip()
    return (
        f"# {task.capitalize()}, {WORDS[rules]}, `{profile}` settings\n\nSeeds {seeds[0]} to "
        f"{seeds[-1]}, commit {commits}. [{task}.csv]({task}.csv) holds every repetition. "
        f"What it says: [the numbers](../results.md).\n\n{text}\n"
    )


PAGES: dict[str, Callable[[], str]] = {
    f"{rules}_{profile}_{task}": lambda s=(rules, profile, task): raw(*s)
    for rules, profile in SETTINGS
    for task in TASKS
}

PICTURES = ("default_stacking", "tuned_throwing")
"""Others would show equal lines."""


def draw() -> None:
    """The pictures, by our rules."""
    for name in PICTURES:
        profile, task = name.split("_")
        with TemporaryDirectory() as folder:
            write(Path(folder), pictures([_summary("ours", profile, task)]))
            picture = Path(folder, f"{task}_metrics.png").read_bytes()
        (DOCS / "pictures" / f"{name}.png").write_bytes(picture)
