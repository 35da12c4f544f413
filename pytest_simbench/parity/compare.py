"""Parity: does the world that the engine built equal the scene, and does it stay so?

What is compared stands in `parity.quantities`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pytest_simbench.description.shapes import DIRECTIONS, OUTLINES
from pytest_simbench.ground.errors import ParityError
from pytest_simbench.parity.quantities import constants
from pytest_simbench.scene import Scene
from pytest_simbench.simulator.info import Deviation

RELATIVE_TOLERANCE = 1e-4
ABSOLUTE_TOLERANCE = 1e-6
"""Single-precision engines keep 7 digits; a wrong mass or height differs by far more."""

LENGTH_TOLERANCE = 1e-5
"""Of what single precision composes from several poses [m]: link poses, outlines, centres."""


@dataclass(frozen=True)
class ParityResult:
    """A world held against its scene.

    Attributes:
        wrong: a sentence for each quantity that differs from the scene, and is not excused.
        deviations: a sentence for each declared deviation that counts in this world: a quantity
            differs by it, the engine does not tell one that it excuses, or it concerns none.
        untold: the quantities that the engine does not tell, as declared.
    """

    wrong: Mapping[str, str]
    deviations: Sequence[str]
    untold: Collection[str]


def compare(
    expected: Mapping[str, Any],
    reported: Mapping[str, Any],
    deviations: Iterable[Deviation],
    simulator: str,
) -> ParityResult:
    """Hold what a simulator reports against what is expected of it."""
    deviations = tuple(deviations)
    wrong: dict[str, str] = {}
    untold: dict[str, Deviation] = {}
    differing: dict[Deviation, str] = {}
    for name, value in expected.items():
        deviation = next((d for d in deviations if d.excuses(name)), None)
        if name not in reported:
            if deviation is None or deviation.within is not None:
                wrong[name] = f"{simulator} reports nothing, and declares no deviation"
            else:
                untold[name] = deviation
        elif not _equal(name, value, reported[name]):
            text = f"scene {_text(value)}, {simulator} {_text(reported[name])}"
            text += _difference_text(value, reported[name])
            if deviation is None:
                wrong[name] = text
            elif _within(deviation, value, reported[name]):
                differing.setdefault(deviation, f"{name}: {text}")
            else:
                limit = f"declared is at most {deviation.within:g}: {deviation.reason}"
                wrong[name] = f"{text} ({limit})"
    for name in sorted(set(reported) - set(expected)):
        wrong[name] = "reported, but not part of the scene"
    untellable = set(untold.values())
    sentences = [_sentence(d, d in untellable, differing.get(d)) for d in deviations]
    return ParityResult(wrong, [sentence for sentence in sentences if sentence], list(untold))


def check(
    expected: Mapping[str, Any],
    reported: Mapping[str, Any],
    deviations: Iterable[Deviation],
    simulator: str,
) -> list[str]:
    """Compare; return one sentence for each declared deviation that counts in this world.

    Raises:
        ParityError: a quantity differs, or differs by more than its deviation allows, or is neither
            reported nor declared; the message gives both values of each (the first ten).
    """
    comparison = compare(expected, reported, deviations, simulator)
    wrong = [f"{name}: {text}" for name, text in comparison.wrong.items()]
    if wrong:
        more = f"; and {len(wrong) - 10} more" if len(wrong) > 10 else ""
        raise ParityError(
            f"{simulator} built another world than the scene describes: "
            + "; ".join(wrong[:10])
            + more
        )
    return list(comparison.deviations)


def misfit(expected: Mapping[str, Any], reported: Mapping[str, Any], body: str) -> float:
    """How far from where the scene has it a body touches others [m], across its own z axis: by its
    shapes' reach, and by their margins. What the engine does not tell counts as right."""
    names, across = [f"body/{body}/{kind}" for kind in OUTLINES], DIRECTIONS[:, 2] == 0.0
    gaps = [_gap(expected[n][:, across], reported[n][:, across]) for n in names if n in reported]
    margin = np.abs(reported.get(f"body/{body}/margin", 0.0)).max()
    return max((gap for gap in gaps if gap is not None), default=0.0) + float(margin)


def _sentence(deviation: Deviation, untold: bool, differing: str | None) -> str:
    """What stands in the record; the same in every repetition of a task."""
    if not deviation.quantity:
        return deviation.reason
    found = ["not told by the engine"] if untold else []
    if differing and deviation.within is not None:
        found.append(f"differs by at most {deviation.within:g}")
    elif differing:
        found.append(differing)
    if not found:
        return ""
    return f"{deviation.quantity}: {deviation.reason} ({'; '.join(found)})"


class Lasting:
    """What may not change while a world is stepped, as it was read when it was loaded.

    Args:
        simulator: what messages call it.
        deviations: declared ones. A shape that an engine tells with an error (it is measured from
            another side each time) may differ by twice that error between two readings.
    """

    def __init__(
        self,
        reported: Mapping[str, Any],
        scene: Scene,
        simulator: str,
        deviations: Sequence[Deviation] = (),
    ) -> None:
        self._scene, self._simulator = scene, simulator
        self._deviations = deviations
        self._first = {name: np.copy(reported[name]) for name in constants(reported, scene)}

    def check(self, reported: Mapping[str, Any], time: float) -> None:
        """Hold all that the engine tells at a later simulated time [s] against the first reading.

        Raises:
            ParityError: something that lasts is another one now; the message gives both values of
                the first such quantity, and names the others.
        """
        now = {name: reported[name] for name in constants(reported, self._scene)}
        names = [n for n in {**self._first, **now} if not self._same(n, now.get(n))]
        if names:
            before, after = self._first.get(names[0]), now.get(names[0])
            more = f"; and {', '.join(names[1:4])}" if names[1:] else ""
            more += f" and {len(names) - 4} more" if len(names) > 4 else ""
            raise ParityError(
                f"{self._simulator} changed {names[0]} while it ran: {_told(before)} when it was "
                f"loaded, {_told(after)} at t = {time:.3f} s{_difference_text(before, after)}{more}"
            )

    def _same(self, name: str, value: Any) -> bool:
        first = self._first.get(name)
        if first is None or value is None:
            return False
        if np.array_equal(first, value) or _equal(name, first, value):
            return True
        gap = _gap(first, value) if name.rpartition("/")[2] in OUTLINES else None
        error = max((d.within or 0.0 for d in self._deviations if d.excuses(name)), default=0.0)
        return gap is not None and gap <= 2 * error


def _equal(name: str, expected: Any, reported: Any) -> bool:
    a, b = np.asarray(expected, dtype=float), np.asarray(reported, dtype=float)
    if a.shape != b.shape:
        return False
    kind = name.rpartition("/")[2]
    if kind == "pose" and np.dot(a[3:], b[3:]) < 0:
        b = np.concatenate([b[:3], -b[3:]])  # q and -q are the same rotation
    if kind in ("inertia", "mass"):  # of a tensor, relative to its largest element
        return bool(np.abs(a - b).max() <= RELATIVE_TOLERANCE * np.abs(a).max() + 1e-12)
    composed = kind in (*OUTLINES, "com", "axis") or name.startswith("link/")
    absolute = LENGTH_TOLERANCE if composed else ABSOLUTE_TOLERANCE
    return bool(np.allclose(a, b, rtol=RELATIVE_TOLERANCE, atol=absolute))


def _within(deviation: Deviation, expected: Any, reported: Any) -> bool:
    if deviation.within is None:
        return True
    gap = _gap(expected, reported)
    return gap is not None and gap <= deviation.within


def _gap(expected: Any, reported: Any) -> float | None:
    """The largest difference of two arrays; None where they have different shapes."""
    a, b = np.asarray(expected, dtype=float), np.asarray(reported, dtype=float)
    return float(np.abs(a - b).max(initial=0.0)) if a.shape == b.shape else None


def _told(value: Any) -> str:
    return "not told" if value is None else _text(value)


def _text(value: Any) -> str:
    array = np.asarray(value, dtype=float)
    if array.size > 9:
        return "x".join(map(str, array.shape)) + " numbers"
    return np.array2string(array, precision=6, separator=", ").replace("\n", "")


def _difference_text(expected: Any, reported: Any) -> str:
    gap = _gap(expected, reported)
    big = np.size(expected) > 9
    return f", which differ by up to {gap:.3g}" if big and gap is not None else ""
