"""Unknowns of a scene from a log: least squares over their logarithms. Coarse points over the
ranges come first, so that a wrong start does less harm; then Levenberg and Marquardt's method from
the best, with differences over two percent of each unknown; and where contacts make these too rough
to go on by, a pattern search without slopes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from scipy.optimize import lsq_linear
from scipy.stats import qmc

from pytest_simbench.records.record import Record
from pytest_simbench.scene import FloatArray, Scene
from pytest_simbench.tasks import Fitting, Log
from pytest_simbench.tuning.target import TuningError
from pytest_simbench.tuning.unknowns import Unknown, begun, changed, starts

COARSE = 4
"""Points over the ranges, for each unknown, and one more."""

RESTARTS = 3
"""Of these the best ones, from which it is tried until the residual is that of the noise."""

STEP = 0.02
"""Of an unknown's logarithm, for differences: contacts make smaller ones rough."""

PATTERN = 1.0
"""First step of the pattern search, of an unknown's logarithm; it ends below `STEP`."""

UNIT, START_STEP = 0.01, 0.1
"""Of the starts of joints [rad or m]; the same of them, in that unit."""

ITERATIONS, TRIES = 12, 4
"""Of the method, and of its damping in each."""

FAR = 1.0, 5.0
"""Of a step: of an unknown's logarithm, and of the start of a joint in `UNIT`."""

ENOUGH = 0.05
"""What a further step may gain [the log of the likelihood]: a third of a standard error."""

FINEST = 1e-5
"""Least noise that is taken where none is stated [m or rad]: no engine's contacts are better."""

WORSE = 8.0
"""The log of the likelihood at three times half an interval: 17 where slopes are right."""

MUCH = 1.5
"""Times the stated noise: the values do not explain the log."""

ROUGH = 1.0
"""Second difference over the first; of what is chaotic 3.5, and of what is smooth 0.1."""

Columns = Mapping[str, FloatArray]


@dataclass(frozen=True)
class State:
    """Where a fit is.

    Attributes:
        point: logarithms of the unknowns, then the starts of joints.
        columns: residuals there.
        slopes: of the residuals over their noise, flat, by each number of the point.
    """

    point: FloatArray
    columns: Columns
    record: Record
    slopes: FloatArray = field(default_factory=lambda: np.zeros(0))


@dataclass(eq=False)
class Fit:
    """A fit of a scene to a log.

    Attributes:
        scene: that the log is of, with the values that the fit begins with.
        noise: of what was measured, a standard deviation [m and rad]; None: told by the residuals
            of each joint and body.
        run: runs a task under a name.
        looks: repetitions so far.
        first: that of the scene's values; those outside their range stand at its end.
    """

    scene: Scene
    log: Log
    unknowns: Sequence[Unknown]
    noise: float | None
    run: Callable[[Fitting, str], Record]
    looks: int = 0
    first: Record | None = None
    _rough: set[tuple[int, str]] = field(default_factory=set)

    def __post_init__(self) -> None:
        self._begun = begun(self.scene, self.log)
        self.starts = starts(self._begun, self.log)
        free = [math.inf] * len(self.starts)
        self.low = np.array([math.log(one.low) for one in self.unknowns] + [-x for x in free])
        self.high = np.array([math.log(one.high) for one in self.unknowns] + free)

    def best(self) -> State:
        """Fit.

        Raises:
            TuningError: nothing runs.
        """
        found: list[State] = []
        coarse = self._coarse()
        for state in coarse[:RESTARTS]:
            found.append(self._least(state))
            if not self.misfit(found[-1].columns):
                break
        best = min(found, key=lambda state: self._cost(state.columns))
        told = best.slopes[:, : len(self.unknowns)].any(axis=0).all()
        if self.misfit(best.columns) or not (told or self.noise):
            best = self._least(self._pattern(best if told else coarse[0]))
        sizes = np.linalg.norm(best.slopes, axis=0)
        if np.linalg.cond(best.slopes / np.maximum(sizes, 1e-9)) > 10:
            best = replace(best, slopes=self._slopes(best, both=True))  # what goes together
        return best

    def widened(self, at: State, k: int, half: float) -> float:
        """Half an interval of an unknown alone, tried out: farther from its middle the log must be
        explained worse. Differences of what contacts make rough are steeper than the whole."""
        side = 1.0 if self.high[k] - at.point[k] > at.point[k] - self.low[k] else -1.0
        far = 3 * half
        while self._inside(k, at.point[k] + side * far):
            point = at.point.copy()
            point[k] += side * far
            new = self._look(point)
            if new is None or self._cost(new.columns) > self._cost(at.columns) + WORSE:
                return half if far <= 3 * half else far
            far *= 4
        return math.inf

    def misfit(self, columns: Columns) -> dict[str, float]:
        """Of columns that are farther off than the stated noise: how many times as far."""
        found = {k: scale / (self.noise or scale) for k, scale in self.scales(columns).items()}
        return {name: times for name, times in found.items() if times > MUCH}

    def _look(self, point: FloatArray) -> State | None:
        """At a point; None where it cannot be simulated."""
        logs, begin = np.split(point, [len(self.unknowns)])
        values = {one.name: math.exp(x) for one, x in zip(self.unknowns, logs, strict=True)}
        for (name, start), x in zip(self.starts.items(), begin, strict=True):
            values[name] = start + UNIT * float(x)
        task = Fitting(changed(self._begun, values), self.log, values)
        record = self.run(task, f"e{self.looks}")
        self.looks += 1
        self.first = self.first or record
        if not record.ok:
            return None
        columns = {name: np.array(rows) for name, rows in record.details["residuals"].items()}
        for name in columns:  # where a body begins is known no better than where it is later
            if "/" in name:
                columns[name] -= columns[name].mean(axis=0)
        return State(point, columns, record)

    def _coarse(self) -> list[State]:
        """The best first."""
        many = len(self.unknowns)
        values = np.log([min(max(one.value, one.low), one.high) for one in self.unknowns])
        drawn = qmc.LatinHypercube(many, rng=1).random(COARSE * many)
        points = [values, *qmc.scale(drawn, self.low[:many], self.high[:many])]
        looks = [self._look(np.append(x, np.zeros(len(self.starts)))) for x in points]
        found = [state for state in looks if state is not None]
        if not found:
            error = self.first.error if self.first else None
            raise TuningError(f"no value can be run: {error.message if error else 'all fail':.300}")
        return sorted(found, key=lambda state: self._cost(state.columns))

    def _least(self, at: State) -> State:
        damping, both = 0.01, True
        far = np.array([FAR[0]] * len(self.unknowns) + [FAR[1]] * len(self.starts))
        for _ in range(ITERATIONS):
            at, both = replace(at, slopes=self._slopes(at, both)), False
            r = self.flat(at.columns, at.columns)
            triangle = np.asarray(np.linalg.qr(np.column_stack([at.slopes, r]), mode="r"))
            slopes, rest = triangle[:, :-1], triangle[:, -1]
            ends = np.maximum(self.low - at.point, -far), np.minimum(self.high - at.point, far)
            for _ in range(TRIES):
                held = np.diag(np.sqrt(damping * np.sum(slopes**2, axis=0) + 1e-9))
                whole = np.concatenate([slopes, held])
                step = lsq_linear(whole, np.append(-rest, np.zeros(len(held))), ends).x
                point = at.point + step
                gain = float(rest @ rest - np.sum((rest + slopes @ step) ** 2)) / 2
                if gain < ENOUGH / 50:
                    return at
                new = self._look(point)
                if new and self._cost(new.columns) < self._cost(at.columns):
                    break
                damping *= 10
            else:
                return at
            at, damping = replace(new, slopes=at.slopes), damping / 10
            if gain < ENOUGH:
                return at
        return at

    def _pattern(self, at: State) -> State:
        """Steps of one unknown at a time, half as long where none is better, until what is left is
        the noise."""
        step = PATTERN
        while step > STEP and (self.misfit(at.columns) or not self.noise):
            best = at
            for k, h in product(range(len(self.unknowns)), (step, -step)):
                point = at.point.copy()
                point[k] += h
                new = self._look(point) if self._inside(k, point[k]) else None
                if new and self._cost(new.columns) < self._cost(best.columns):
                    best = new
            step = step / 2 if best is at else step
            at = best
        return at

    def _slopes(self, at: State, both: bool) -> FloatArray:
        """Differences to one side, or to both. What jumps about as an unknown changes does not tell
        it: there they are 0."""
        slopes = []
        for k, x in enumerate(at.point):
            step = STEP if k < len(self.unknowns) else START_STEP
            found: list[tuple[float, Columns]] = []
            for h in (step, -step):
                moved = at.point.copy()
                moved[k] += h
                if (both or not found) and self._inside(k, x + h) and (new := self._look(moved)):
                    found.append((h, new.columns))
            if not found:
                raise TuningError("the scene cannot be simulated beside the best values")
            (h, up), (other, down) = found[0], (*found, (0.0, at.columns))[1]
            slope = {name: (up[name] - down[name]) / (h - other) for name in up}
            for name, rows in at.columns.items() if other else ():
                second = np.linalg.norm(up[name] + down[name] - 2 * rows)
                rough = second > ROUGH * h * np.linalg.norm(slope[name])
                (self._rough.add if rough else self._rough.discard)((k, name))
            slope = {name: rows * ((k, name) not in self._rough) for name, rows in slope.items()}
            slopes.append(self.flat(slope, at.columns))
        return np.transpose(slopes)

    def _inside(self, k: int, x: float) -> bool:
        return bool(self.low[k] <= x <= self.high[k])

    def scales(self, columns: Columns) -> dict[str, float]:
        """Of each column the noise that it is held against: as stated, but no less than what is
        left of it, so that what the scene does not explain counts for less."""
        least = self.noise or FINEST
        return {k: max(least, float(np.sqrt(np.mean(v**2)))) for k, v in columns.items()}

    def flat(self, columns: Columns, at: Columns) -> FloatArray:
        """All residuals over the noise that it is where those of `at` are left."""
        scales = self.scales(at).items()
        return np.concatenate([columns[name].ravel() / scale for name, scale in scales])

    def _cost(self, columns: Columns) -> float:
        """Minus the log of the likelihood."""
        r, scales = self.flat(columns, columns), self.scales(columns).items()
        return float(r @ r) / 2 + sum(columns[k].size * math.log(scale) for k, scale in scales)
