"""Makes every table of measured outcomes and costs, in README.md and docs/, from one source.

python docs/make_results.py RUNS COMMIT    reads run folders into docs/data/*.csv, then the rest
python docs/make_results.py                writes tables and pictures from docs/data/*.csv
python docs/make_results.py --tables       the tables in the pages alone

RUNS holds the folders RULES-PROFILE-TASK/SIMULATOR, for instance ours-tuned-stacking/mujoco. RULES
are `ours`, `study` (`Stacking.study()`), or the name of a single rule (`published_runs.RULES`).
COMMIT is that of the code that ran. A folder replaces what the CSV had of the same configuration.

A table stands in a page between `<!-- made: NAME -->` and `<!-- end -->`.
"""

from __future__ import annotations

import csv
import re
import statistics
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from published_runs import (
    DATA,
    METRICS,
    PARTS,
    PROFILES,
    REPETITIONS,
    RULES,
    SETTINGS,
    SIMULATORS,
    TASKS,
    Run,
    Runs,
    load,
    read_folders,
)

from pytest_simbench.measure.comparison import compare_by_seed, holm
from pytest_simbench.report.figures.drawing import write
from pytest_simbench.report.figures.task import pictures
from pytest_simbench.report.markdown import run as markdown
from pytest_simbench.report.model import cells
from pytest_simbench.report.model.summary import summarise
from pytest_simbench.tasks import Throwing

DOCS = Path(__file__).resolve().parent
PLURALS = {"stacking": "stackings", "throwing": "throws"}
WORDS = {"ours": "our rules", "study": "the study's rules"}


def table(headings: Sequence[str], rows: Iterable[Sequence[str]], left: int = 1) -> str:
    marks = [":--" if k < left else "--:" for k in range(len(headings))]
    return "\n".join(f"| {' | '.join(row)} |" for row in (headings, marks, *rows))


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
    return f"Not measured again yet: {names} ([earlier](docs/results.md#earlier-numbers))."


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


def earlier(runs: Runs) -> str:
    """Numbers of before, for what has no new run."""
    with (DATA / "earlier.csv").open(encoding="utf-8", newline="") as file:
        headings, *lines = csv.reader(file)
    rows = []
    for profile, task, simulator, *rest in lines:
        run = runs.get(("ours", profile.split(",")[0], task, simulator))
        if run is None or len(run.lines) < REPETITIONS:
            rows.append([page_link(simulator), profile, task, *rest])
    order = [headings[2], headings[0], headings[1], *headings[3:]]
    return table(order, rows, 3) if rows else "Everything was measured again."


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
    "earlier": earlier,
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

MADE = re.compile(r"(<!-- made: ([\w ]+) -->\n).*?(<!-- end -->)", re.S)


def pages() -> dict[Path, str]:
    """Every page with tables of ours, as it should be."""
    runs = load()
    found = {}
    for path in (DOCS.parent / "README.md", *sorted(DOCS.rglob("*.md"))):
        text = path.read_text("utf-8")
        if "_build" not in path.parts and MADE.search(text):
            found[path] = MADE.sub(lambda m: f"{m[1]}\n{TABLES[m[2]](runs)}\n\n{m[3]}", text)
    return found


def raw(runs: Runs) -> None:
    """All numbers of each setting, and who beats whom; and the pictures."""
    for rules, profile in SETTINGS:
        for task in TASKS:
            found = _of(runs, rules, profile, task)
            if not found:
                continue
            records = [record for _, run in found for record in run.records()]
            whole = TASKS[task].study() if rules == "study" else TASKS[task]
            summary = summarise(records, {task: whole.metrics}, {task: whole.references})
            name = f"{rules}_{profile}_{task}"
            text = markdown.render_task(summary[0], 1).split("\n", 1)[1].strip()
            title = f"# {task.capitalize()}, {WORDS[rules]}, `{profile}` settings"
            seeds = sorted({record.seed for record in records})
            commits = sorted({line["commit"] for _, run in found for line in run.lines})
            head = (
                f"Seeds {seeds[0]} to {seeds[-1]}, commit {', '.join(commits)}. Made by "
                f"`docs/make_results.py` from [{task}.csv]({task}.csv), which has every repetition."
                " What it says: [the numbers](../results.md)."
            )
            (DATA / f"{name}.md").write_text(f"{title}\n\n{head}\n\n{text}\n", "utf-8")
            if rules == "ours":
                with TemporaryDirectory() as folder:
                    write(Path(folder), pictures(summary))
                    picture = Path(folder, f"{task}_metrics.png").read_bytes()
                (DOCS / "pictures" / f"{profile}_{task}.png").write_bytes(picture)


def main(arguments: list[str]) -> None:
    if len(arguments) == 2:
        read_folders(Path(arguments[0]), arguments[1])
    elif arguments not in ([], ["--tables"]):
        sys.exit(__doc__)
    for path, text in pages().items():
        path.write_text(text, "utf-8")
    if arguments != ["--tables"]:
        raw(load())


if __name__ == "__main__":
    main(sys.argv[1:])
