"""Laws over time steps: orders of convergence, the cheapest step, and pictures of both."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from pytest_simbench.ground.names import file_name
from pytest_simbench.ground.text import for_figure, for_terminal
from pytest_simbench.measure.convergence import Convergence
from pytest_simbench.measure.sweep import REFERENCE, Choice, Line, Point, Swept, choice, sweeps
from pytest_simbench.records.folder import Reading
from pytest_simbench.records.phenomena import ordered
from pytest_simbench.records.series import step_text
from pytest_simbench.report.figures.task import drawing, line_style, save
from pytest_simbench.report.model import cells
from pytest_simbench.report.terminal.grid import Column, fill, render

TITLE = "the same laws over time steps"

LEGEND = (
    f"10/10 2ms 0.011: with steps of 2 ms 10 of 10 laws have an error that a step of "
    f"{1e3 * REFERENCE:g} ms may cost, at 0.011 CPU seconds for a simulated second; no other step "
    "keeps more, and none that keeps as many is cheaper"
)

READING = (
    "Order: the slope of the error over the step, both logarithmic, with its 95 % interval; 1 is "
    "what an integrator of the first order has, 0 says that the step does not matter. Exact: every "
    "error is 0. Rounding: nearly all are as small as single precision may add up to."
)

Who = tuple[str, str, str, int]
Texts = Callable[[Swept, Line], list[str]]

WIDE = 4
"""Panels beside each other in a picture."""

BROKEN = f"laws that no step keeps with the error that {1e3 * REFERENCE:g} ms may cost"
"""Title of their table."""

NOTHING = "no error to draw"
"""Of a law that every simulator keeps exactly, or that none finished."""

SHOWN = 3
"""Failures that the terminal tells without `-v`."""

OVER = {"step": "time step [ms]", "cost": "CPU s for a simulated s"}
"""What pictures show the error over, with the label of the axis."""


def of_run(reading: Reading) -> list[Swept]:
    """The laws over time steps that a run has."""
    return sweeps(reading.records, reading.metrics)


def table(found: Sequence[Swept]) -> list[Column]:
    """Simulators by phenomena: the step to take."""
    names = labels(found)
    columns = [Column("simulator", [[name] for name in names.values()], left=True)]
    for phenomenon in phenomena(found):
        of = [law for law in found if law.phenomenon == phenomenon]
        columns.append(Column(phenomenon, [_choice(choice(of, who)) for who in names]))
    return columns


def details(found: Sequence[Swept]) -> list[tuple[str, list[Column]]]:
    """For each phenomenon its laws by simulators: the order, the cheapest step that keeps the law
    with its own tolerance, and with that of `REFERENCE`; then what no step helps, and what failed.
    """
    kinds: list[tuple[str, Texts]] = [
        ("order of convergence", lambda law, line: [_order(line.order)]),
        ("cheapest step that keeps the law, CPU s/sim s",
         lambda law, line: _step(line.cheapest_kept)),
        (f"cheapest step with the error that {1e3 * REFERENCE:g} ms may cost, CPU s/sim s",
         lambda law, line: _step(line.cheapest_within(law.allowed))),
    ]  # fmt: skip
    tables = []
    for phenomenon in phenomena(found):
        of = [law for law in found if law.phenomenon == phenomenon]
        for title, texts in kinds:
            tables.append((f"{phenomenon}: {title}", _by_law(of, texts)))
    for title, headings, rows in (
        (BROKEN, ("simulator", "laws"), broken(found)),
        ("what failed at a time step", ("simulator", "law", "steps", "message"), failures(found)),
    ):
        if rows:
            last = len(headings) - 1
            columns = [
                Column(heading, [[row[k]] for row in rows], left=True, wrap=k == last)
                for k, heading in enumerate(headings)
            ]
            tables.append((title, columns))
    return tables


def broken(found: Sequence[Swept]) -> list[tuple[str, str]]:
    """The laws that a simulator keeps at none of its steps, held against the error that `REFERENCE`
    may cost: no smaller step helps there."""
    told = []
    for who, name in labels(found).items():
        lines = [(law, line) for law in found for line in law.lines if line.who == who]
        laws = [
            law.law
            for law, line in lines
            if not math.isnan(law.allowed) and line.cheapest_within(law.allowed) is None
        ]
        if laws:
            told.append((name, ", ".join(laws)))
    return told


def failures(found: Sequence[Swept]) -> list[tuple[str, str, str, str]]:
    """What a simulator could not do: its name, the law, at which steps, and the first message."""
    names = labels(found)
    told = []
    for law in found:
        for line in law.lines:
            failed = [point for point in line.points if math.isinf(point.error)]
            if failed:
                steps = ", ".join(step_text(point.step) for point in failed)
                told.append((names[line.who], law.law, steps, failed[0].message))
    return told


def brief(found: Sequence[Swept], width: int) -> list[str]:
    """For the terminal, as lines: the table, and the first failures."""
    lines = [*render(table(found), width).splitlines(), "", *fill(LEGEND, width).splitlines()]
    failed = failures(found)
    for name, law, steps, message in failed[:SHOWN]:
        text = for_terminal(f"{name} fails {law} at {steps}: {message}")
        lines += fill(text, width, "  ").splitlines()[:2]
    if len(failed) > SHOWN:
        lines.append(f"{len(failed) - SHOWN} more such failures with -v and in the report")
    return lines


def whole(found: Sequence[Swept], width: int) -> list[str]:
    """The same, and every law."""
    lines = brief(found, width)
    for title, columns in details(found):
        lines += ["", title, *render(columns, width).splitlines()]
    return [*lines, "", *fill(READING, width).splitlines()]


def phenomena(found: Sequence[Swept]) -> list[str]:
    """Those that there are, in the order of tables."""
    return ordered(law.phenomenon for law in found)


def labels(found: Sequence[Swept]) -> dict[Who, str]:
    """Short names of the configurations: mode and profile only where they differ."""
    every = sorted({line.who for law in found for line in law.lines})
    modes, profiles = (len({who[k] for who in every}) > 1 for k in (1, 2))
    names = {}
    for who in every:
        parts = [who[1]] * modes + [who[2]] * profiles + [f"settings {who[3]}"] * (who[3] > 1)
        names[who] = f"{who[0]} ({', '.join(parts)})" if parts else who[0]
    return names


def write_pictures(folder: Path, found: Sequence[Swept]) -> list[Path]:
    """Draw two pictures of each phenomenon as PNG files, `sweep_PHENOMENON_step.png` and
    `..._cost.png`, and return the paths.

    Raises:
        FiguresUnavailable: matplotlib is not installed.
        OSError: the folder cannot be written to.
    """
    paths = []
    with drawing():
        for phenomenon in phenomena(found):
            for over in OVER:
                name = file_name(f"sweep_{phenomenon.replace(' ', '_')}_{over}")
                paths.append(save(draw(found, phenomenon, over), folder, name))
    return paths


def draw(found: Sequence[Swept], phenomenon: str, over: str) -> Any:
    """The error of each law of a phenomenon as a `matplotlib.figure.Figure`, within
    `figures.drawing`: a panel for each law, a line for each simulator.

    Args:
        found: the laws.
        phenomenon: which of them.
        over: `step` or `cost`, see `OVER`.
    """
    from matplotlib.figure import Figure

    laws = [law for law in found if law.phenomenon == phenomenon]
    names = labels(found)
    rows = math.ceil(len(laws) / WIDE)
    wide = min(len(laws), WIDE)
    figure: Any = Figure(figsize=(1 + 2.9 * wide, 0.9 + 2.4 * rows), layout="constrained")
    panels = figure.subplots(rows, wide, squeeze=False).flatten()
    for axis, law in zip(panels, laws, strict=False):
        for place, (who, name) in enumerate(names.items()):
            for line in (line for line in law.lines if line.who == who):
                x, y = _course(line.points, over)
                axis.plot(x, y, ms=4, label=for_figure(name), **line_style(place))
        if over == "step" and law.tolerances:
            steps = sorted(law.tolerances)
            axis.plot([1e3 * h for h in steps], [law.tolerances[h] for h in steps], color="0.6",
                      lw=4, alpha=0.5, zorder=0, label="tolerance")  # fmt: skip
        if any(len(line.get_xdata()) for line in axis.lines):
            axis.set_xscale("log")
            axis.set_yscale("log", nonpositive="mask")
        else:  # which has no logarithm
            axis.text(0.5, 0.5, NOTHING, transform=axis.transAxes, ha="center", fontsize="small")
        for side in (axis.xaxis, axis.yaxis):  # matplotlib's own labels are formulas
            side.set_major_formatter("{x:g}")
            side.set_minor_formatter("")
        axis.set_title(for_figure(law.law), fontsize="medium")
        axis.set_xlabel(OVER[over], fontsize="small")
        axis.set_ylabel(for_figure(f"error, {law.unit}" if law.unit else "error"), fontsize="small")
        axis.tick_params(labelsize="small")
        axis.grid(alpha=0.4)
    for axis in panels[len(laws) :]:
        axis.set_visible(False)
    known: dict[str, Any] = {}
    for axis in panels[: len(laws)]:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            known.setdefault(label, handle)
    figure.legend(list(known.values()), list(known), loc="outside lower center",
                  ncols=min(8, len(known)), frameon=False, fontsize="small")  # fmt: skip
    return figure


def caption(phenomenon: str, over: str) -> str:
    """What a picture shows, in words."""
    what = "time step" if over == "step" else "CPU seconds for a simulated second"
    return f"{phenomenon}: error over {what}; a failure and an error of 0 are not drawn"


def _course(points: Sequence[Point], over: str) -> tuple[list[float], list[float]]:
    """What is drawn of a line."""
    shown = [(p.step * 1e3 if over == "step" else p.cost, p.error) for p in points]
    fine = [(x, y) for x, y in shown if x and math.isfinite(y) and y > 0]
    return [x for x, _ in fine], [y for _, y in fine]


def _by_law(laws: Sequence[Swept], texts: Texts) -> list[Column]:
    """Laws by simulators."""
    columns = [Column("law", [[law.law] for law in laws], left=True)]
    for who, name in labels(laws).items():
        shown = []
        for law in laws:
            line = next((line for line in law.lines if line.who == who), None)
            shown.append([cells.MISSING] if line is None else texts(law, line))
        columns.append(Column(name, shown))
    return columns


def _choice(found: Choice | None) -> list[str]:
    if found is None:
        return [cells.MISSING]
    told = [f"{found.kept}/{found.laws}"]
    if found.kept:
        told[0] += f" {step_text(found.step)}"
        told += [cells.number(found.cost, 2)] if found.cost is not None else []
    return told


def _step(found: Point | None) -> list[str]:
    if found is None:
        return ["none"]
    cost = [] if found.cost is None else [cells.number(found.cost, 2)]
    return [step_text(found.step), *cost]


def _order(found: Convergence) -> str:
    if found.kind != "order":
        return found.kind if found.kind != "unknown" else cells.MISSING
    text = _number(found.order)
    if math.isfinite(found.low):
        text += f" [{_number(found.low)}, {_number(found.high)}]"
    return text


def _number(value: float) -> str:
    """With two decimals, and no minus before a zero."""
    return f"{value:.2f}".replace("-0.00", "0.00")
