"""What a user types to run one repetition again."""

from __future__ import annotations

import shlex

from pytest_simbench.records.record import Record


def command(record: Record) -> str:
    """What runs the same seed of the same test again; empty where its id is no plain one.

    Settings that `--sim-set` changed are not in it. A profile, a robot or a time step in the id is
    one of several that the run had: a run of this one alone has none there.
    """
    file, _, name = record.function.partition("::")
    step = record.settings.get("timestep")
    alone = f"{record.function}[{record.simulator}-{record.mode}"
    ours_first = record.test.startswith(alone)
    test = f"{'-'.join(filter(None, [alone, record.variant]))}]" if ours_first else record.test
    fine = name and record.test.isprintable() and not file.startswith(("-", "/", "."))
    if not fine or ".." in file or not file.endswith(".py"):
        return ""
    options = [
        f"--sim-name={record.simulator}",
        f"--sim-seed={record.seed}",
        "--sim-reps=1",
        f"--sim-profile={record.profile}",
        f"--sim-protocol={record.protocol}",
        f"--sim-jitter={record.jitter:g}",
        *[f"--sim-robot={record.robot.get('name')}"] * bool(record.robot),
        *["--sim-gui"] * (record.mode == "gui"),
        *[f"--sim-set={record.simulator}.timestep={step!r}"] * record.swept,
    ]
    if not all(map(str.isprintable, options)):
        return ""
    return shlex.join(["pytest", test, *options])
