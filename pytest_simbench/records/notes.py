"""What the tool notes of a repetition; `details` are the task's alone."""

from __future__ import annotations

from dataclasses import dataclass

from pytest_simbench.records.readings import Reading
from pytest_simbench.records.tuned_on import Sample, Seen


@dataclass(frozen=True)
class Wait:
    """How long a task waited for its count.

    Attributes:
        seconds, of: simulated time that it waited, and the whole wait [s].
        bound: what was nearest to a change when it ended early, `support of cube_07`; empty: it
            waited in full.
        reach, slack: how far that body might have moved in the rest of the wait, and how far it
            would have had to [m].
    """

    seconds: float
    of: float
    bound: str = ""
    reach: float = 0.0
    slack: float = 0.0


@dataclass(frozen=True)
class Notes:
    """What the tool notes of a repetition besides its numbers.

    Attributes:
        log: the worker's log, a path in the run folder.
        closing: why the worker did not end well, after the task had.
        untested: a sentence on a version of the engine that nobody has tested.
        filmed: whether it was filmed.
        video, trace: why the film ended early, why the motion was not written.
        left_out: why its details are not there.
        own_timestep: the time step that its profile has [s], where a sweep took another one.
        chosen_on: by what its settings were chosen.
        profile_file: the file that its profile is of, as it was given.
        needs: options with the user's own files, without which its test is not there.
        sample: the measured motion that it was held against.
        reading: of a law: measured, right, and the tolerance.
        wait: for the count.
        sole: whether others would be the same: the task draws nothing, and the simulator claims to
            be deterministic.
        opened: by how much loops of the robot were open at the end, at most, where that is more
            than 1 mm [m].
        lost_nodes: machines of a cluster that were lost with it before, and how.
    """

    log: str = ""
    closing: str = ""
    untested: str = ""
    filmed: bool = False
    video: str = ""
    trace: str = ""
    left_out: str = ""
    own_timestep: float | None = None
    chosen_on: tuple[Seen, ...] = ()
    profile_file: str = ""
    needs: tuple[str, ...] = ()
    sample: Sample | None = None
    reading: Reading | None = None
    wait: Wait | None = None
    sole: bool = False
    opened: float = 0.0
    lost_nodes: tuple[str, ...] = ()
