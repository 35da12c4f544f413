"""The same seed, the same commands, again: is the result the same?

The task runs once in a fresh process and its commands are put on a tape. Then they are sent
again, to the last bit, after each of the things that should not matter.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from pytest_simbench.client.errors import Unavailable, WorkerError
from pytest_simbench.client.tape import Operation, TapedWorld
from pytest_simbench.repeatability.episode import Episode, Experiment, changed
from pytest_simbench.repeatability.motions import Difference, difference
from pytest_simbench.session.handle import SimulatorHandle
from pytest_simbench.simulator.info import Capability
from pytest_simbench.tasks import Jitter, LeaningTowers

ASTRAY = 0.3
"""How long a world goes on after its state was saved, before it is restored [s]."""


@dataclass(frozen=True)
class Moment:
    """A moment of a task at which the state is saved and restored.

    Attributes:
        name: for tables.
        phase: of the task.
        operation: number of the operation in that phase before which it happens, from 0.
    """

    name: str
    phase: str
    operation: int = 0


THROWING_MOMENTS = (Moment("in the grip", "wind up"), Moment("in flight", "throw", 1))
"""Of `tasks.Throwing`: before winding up with the cube between the fingers, and when the swing has
ended, by when the cube is on its way."""


@dataclass(frozen=True)
class Again:
    """One way of running again, and what came of it.

    Attributes:
        way: what was done in between, for tables.
        difference: where it parted from the first run; None: nowhere.
        changed: counts of the task's outcome that are not the same.
        left_at: when the task no longer asked for what the tape has next [s].
        skipped: why it was not run, "" when it was.
        failure: the error that ended it, "" when there was none.
        claimed: whether the adapter claims that this way gives the same.
    """

    way: str
    difference: Difference | None = None
    changed: tuple[str, ...] = ()
    left_at: float | None = None
    skipped: str = ""
    failure: str = ""
    claimed: bool = True

    @property
    def identical(self) -> bool:
        """Whether it ran and every bit was the same."""
        return not (self.skipped or self.failure or self.difference)

    @property
    def text(self) -> str:
        """The result in words."""
        if self.skipped or self.failure:
            return self.skipped or self.failure
        if self.difference is None:
            return "bit-identical"
        d = self.difference
        growth = ", ".join(
            f"{1000 * gap:.3g} mm {after:g} s later"
            for after, gap in d.growth.items()
            if gap is not None
        )
        what = f"first differs at t = {d.first:.2f} s"
        what += f" ({d.body})" if d.body else " (robot)"
        what += f", then {growth}" if growth else ""
        what += f", {1000 * d.largest:.3g} mm at most"
        return what + (f"; changed {', '.join(self.changed)}" if self.changed else "")

    def to_wire(self) -> dict[str, Any]:
        d = self.difference
        return {
            "way": self.way,
            "identical": self.identical,
            "first": None if d is None else d.first,
            "body": None if d is None else d.body,
            "growth": None if d is None else {f"{k:g}": v for k, v in d.growth.items()},
            "largest": None if d is None else d.largest,
            "changed": list(self.changed),
            "left_at": self.left_at,
            "skipped": self.skipped,
            "failure": self.failure,
            "claimed": self.claimed,
        }

    @classmethod
    def from_wire(cls, data: Mapping[str, Any]) -> Again:
        found = None
        if data["first"] is not None:
            growth = {float(key): value for key, value in data["growth"].items()}
            found = Difference(data["first"], data["body"], growth, data["largest"])
        return cls(
            data["way"],
            found,
            tuple(data["changed"]),
            data["left_at"],
            data["skipped"],
            data["failure"],
            data.get("claimed", True),
        )


@dataclass(frozen=True)
class Replay:
    """All ways of running one seed again in one simulator.

    Attributes:
        simulator: its name.
        claims: whether its adapter claims that it is deterministic.
        first: the run that the others are compared with.
        again: the ways, with their results.
    """

    simulator: str
    claims: bool
    first: Episode
    again: tuple[Again, ...]

    def to_wire(self) -> dict[str, Any]:
        """Plain data for the run's records."""
        return {
            "claims": self.claims,
            "counts": dict(self.first.counts),
            "again": [again.to_wire() for again in self.again],
        }

    def assert_as_claimed(self) -> None:
        """Raise AssertionError when a way that is claimed to give the same does not, or when the
        simulator could not run again what it ran before.

        Claimed are, with the capability `deterministic`, all ways but those that restore a state,
        and with `exact_restore` those.
        """
        bad = [
            f"{again.way}: {again.text}"
            for again in self.again
            if again.failure or (again.claimed and not again.identical and not again.skipped)
        ]
        if bad:
            head = "claims to be deterministic, but" if self.claims else "could not run again"
            raise AssertionError(f"{self.simulator} {head}\n  " + "\n  ".join(bad))


def replay(
    experiment: Experiment,
    *,
    claims: bool,
    capabilities: frozenset[Capability],
    fresh: SimulatorHandle,
    other_mode: SimulatorHandle | str,
    moments: tuple[Moment, ...] = THROWING_MOMENTS,
) -> Replay:
    """Run an experiment and run it again in every way.

    Args:
        experiment: its handle should not have been used before.
        claims: whether the adapter claims determinism.
        capabilities: of the simulator.
        fresh: a handle of the same case, for a process of its own.
        other_mode: a handle in the other mode (with a window, when the first has none), or why
            there is none.
        moments: at which to save and restore.

    Raises:
        WorkerError: in the first run; later ones are results.
    """
    simulator = experiment.handle.case.simulator
    restores = Capability.EXACT_RESTORE in capabilities
    first = experiment.run()
    results = [
        _again("after a reset", first, lambda: experiment.run(play=first.tape)),
        _again("after another episode", first, lambda: _after_another(experiment, first)),
    ]
    for moment in moments:
        way = f"restored {moment.name}"
        if Capability.SAVE_RESTORE not in capabilities:
            results.append(Again(way, skipped=f"{simulator} cannot save and restore"))
        else:
            restored = _restored(way, moment, experiment, first)
            results.append(replace(restored, claimed=restores))
    results.append(
        _again("fresh process", first, lambda: experiment.run(play=first.tape, handle=fresh))
    )
    mode = "headless" if experiment.handle.case.mode == "gui" else "with a window"
    if isinstance(other_mode, str):
        results.append(Again(mode, skipped=other_mode))
    else:
        other = other_mode
        results.append(_again(mode, first, lambda: experiment.run(play=first.tape, handle=other)))
    if not claims:
        results = [replace(again, claimed=False) for again in results]
    return Replay(simulator, claims, first, tuple(results))


def _again(way: str, first: Episode, run: Callable[[], Episode]) -> Again:
    try:
        second = run()
    except Unavailable as error:
        return Again(way, skipped=error.what)
    except WorkerError as error:
        return Again(way, failure=f"{type(error).__name__}: {error.what}")
    return Again(
        way,
        difference(first.motions, second.motions, first.bodies),
        tuple(changed(first.counts, second.counts)),
        second.left_at,
    )


def _after_another(experiment: Experiment, first: Episode) -> Episode:
    """Another scene in the same process, then the experiment."""
    another = LeaningTowers().smoke()
    with experiment.handle.episode(another.scene(0, Jitter())) as world:
        world.wait(0.5)
    return experiment.run(play=first.tape)


def _restored(way: str, moment: Moment, experiment: Experiment, first: Episode) -> Again:
    """Save at a moment, go on for a while, restore, and carry on."""
    counter = _Counter(moment)

    def before(world: TapedWorld, operation: Operation) -> None:
        if counter.reached(operation):
            world.save("replay")
            world.perform(operation)
            world.perform(Operation("wait", {"duration": ASTRAY}))
            world.restore("replay")

    result = _again(way, first, lambda: experiment.run(play=first.tape, before=before))
    if not counter.done and not result.failure:
        return Again(way, skipped=f"the task never came to {moment.phase}")
    return result


class _Counter:
    """Tells when a moment has come."""

    def __init__(self, moment: Moment) -> None:
        self.moment = moment
        self.done = False
        self._seen = 0

    def reached(self, operation: Operation) -> bool:
        if self.done or operation.phase != self.moment.phase:
            return False
        self._seen += 1
        self.done = self._seen > self.moment.operation
        return self.done
