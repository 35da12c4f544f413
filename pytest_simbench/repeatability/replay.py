"""The same seed, the same commands, again: is the result the same?

The task runs once in a fresh process and its commands are put on a tape. Then they are sent
again, to the last bit, after each of the things that should not matter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from pytest_simbench.client.errors import Unavailable, WorkerError
from pytest_simbench.client.tape import Operation, TapedWorld
from pytest_simbench.experiment.handle import SimulatorHandle
from pytest_simbench.records.repeatability import Again
from pytest_simbench.repeatability.episode import Episode, Episodes, changed
from pytest_simbench.repeatability.motions import difference
from pytest_simbench.scene import Box, Pose, Scene
from pytest_simbench.simulator.info import Capability
from pytest_simbench.tasks import Moment

ASTRAY = 0.3
"""How long a world goes on after its state was saved, before it is restored [s]."""

ANOTHER = Scene(
    "another",
    (
        Box("below", (0.05, 0.05, 0.05), Pose.at(0.4, 0.0, 0.025), mass=0.1),
        Box("beside", (0.05, 0.05, 0.05), Pose.at(0.43, 0.0, 0.09, yaw=0.3), mass=0.1),
    ),
)
"""What a process simulates between two runs of an experiment: a cube falls upon another's edge."""


@dataclass(frozen=True)
class Replay:
    """All ways of running one seed again in one simulator.

    Attributes:
        claims: whether its adapter claims that it is deterministic.
        first: the run that the others are compared with.
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
    episodes: Episodes,
    *,
    capabilities: frozenset[Capability],
    fresh: SimulatorHandle,
    other_mode: SimulatorHandle | str,
    moments: Sequence[Moment] | None = None,
    jobs: int = 1,
) -> Replay:
    """Run an experiment and run it again in every way.

    Args:
        episodes: its handle should not have been used before.
        fresh: a handle of the same case, for a process of its own.
        other_mode: a handle in the other mode (with a window, when the first has none), or why
            there is none.
        moments: at which to save and restore; by default those that the task declares.
        jobs: how many workers may run side by side.

    Raises:
        WorkerError: in the first run; later ones are results.
    """
    simulator = episodes.handle.case.simulator
    moments = episodes.task.moments if moments is None else moments
    first = episodes.run()
    mode = "headless" if episodes.handle.case.mode == "gui" else "with a window"
    ways: list[tuple[str, SimulatorHandle | str]] = [("fresh process", fresh), (mode, other_mode)]
    elsewhere = [partial(_elsewhere, way, handle, episodes, first) for way, handle in ways]
    with ThreadPoolExecutor(max(1, jobs - 1), thread_name_prefix="simbench-replay") as pool:
        started = [pool.submit(run) for run in elsewhere if jobs > 1]
        try:
            results = [
                _again("after a reset", first, lambda: episodes.run(play=first.tape)),
                _again("after another episode", first, lambda: _after_another(episodes, first)),
                *_restored_at(moments, capabilities, episodes, first),
            ]
            results += [future.result() for future in started] or [run() for run in elsewhere]
        except BaseException:
            _end(started, [handle for _, handle in ways])
            raise
    claims = Capability.DETERMINISTIC in capabilities
    if not claims:
        results = [replace(again, claimed=False) for again in results]
    return Replay(simulator, claims, first, tuple(results))


def _elsewhere(
    way: str, handle: SimulatorHandle | str, episodes: Episodes, first: Episode
) -> Again:
    """In a worker of its own, or the reason why there is none."""
    if isinstance(handle, str):
        return Again(way=way, skipped=handle)
    return _again(way, first, lambda: episodes.run(play=first.tape, handle=handle))


def _end(started: Sequence[Future[Again]], handles: Sequence[SimulatorHandle | str]) -> None:
    """End what runs side by side."""
    for future in started:
        future.cancel()
    going = True
    while going:
        going = bool(wait(started, timeout=0.1).not_done)
        for handle in handles:  # a worker that was just being started is there in the next round
            if isinstance(handle, SimulatorHandle):
                handle.close()


def _restored_at(
    moments: Sequence[Moment],
    capabilities: frozenset[Capability],
    episodes: Episodes,
    first: Episode,
) -> Iterator[Again]:
    if not moments:
        yield Again(way="restored", skipped=f"the task {episodes.task.name!r} declares no moments")
    for moment in moments:
        way = f"restored {moment.name}"
        if Capability.SAVE_RESTORE not in capabilities:
            simulator = episodes.handle.case.simulator
            yield Again(way=way, skipped=f"{simulator} cannot save and restore")
        else:
            restored = _restored(way, moment, episodes, first)
            yield replace(restored, claimed=Capability.EXACT_RESTORE in capabilities)


def _again(way: str, first: Episode, run: Callable[[], Episode]) -> Again:
    try:
        second = run()
    except Unavailable as error:
        return Again(way=way, skipped=error.what)
    except WorkerError as error:
        return Again(way=way, failure=f"{type(error).__name__}: {error.what}")
    return Again(
        way=way,
        changed=changed(first.counts, second.counts),
        left_at=second.left_at,
        **vars(difference(first.motions, second.motions, first.bodies)),
    )


def _after_another(episodes: Episodes, first: Episode) -> Episode:
    """Another scene in the same process, then the experiment."""
    with episodes.handle.episode(ANOTHER) as world:
        world.wait(0.5)
    return episodes.run(play=first.tape)


def _restored(way: str, moment: Moment, episodes: Episodes, first: Episode) -> Again:
    """Save at a moment, go on for a while, restore, and carry on."""
    seen = 0  # operations in the moment's phase

    def before(world: TapedWorld, operation: Operation) -> None:
        nonlocal seen
        here = operation.phase == moment.phase
        seen += here
        if here and seen == moment.operation + 1:
            world.save("replay")
            world.perform(operation)
            world.perform(Operation("wait", {"duration": ASTRAY}))
            world.restore("replay")

    result = _again(way, first, lambda: episodes.run(play=first.tape, before=before))
    if seen <= moment.operation and not result.failure:
        return Again(way=way, skipped=f"the task never came to {moment.phase}")
    return result
