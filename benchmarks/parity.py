"""The table of planted faults: what finds each, in each engine. Writes docs/parity.md.

    python benchmarks/parity.py [SIMULATOR ...]

Each fault of `pytest_simbench.testing.faults` is planted in each engine for real: the adapter
builds the faulty scene, is made to remember the true one, and reads back. What only an engine's
own functions can change (restitution, margins, ...) is planted by tests/sims; here it is looked
up whether the engine tells it.
"""

from __future__ import annotations

import sys
from fnmatch import fnmatchcase
from pathlib import Path

from pytest_simbench.client.environments import missing
from pytest_simbench.simulator.parity import ParityResult
from pytest_simbench.simulator.registry import adapter, registered
from pytest_simbench.testing import CHECKS, Subject
from pytest_simbench.testing.faults import FAULTS, Fault, rounds
from pytest_simbench.testing.parity import planted

PAGE = Path(__file__).parent.parent / "docs" / "parity.md"

IN_THE_ENGINE = {
    "what touches bounces": "body/*/restitution",
    "what touches the ground bounces": "ground/restitution",
    "a body rests at a distance": "body/*/margin",
    "a link rests at a distance": "link/*/margin",
    "a body's motion is damped": "body/*/damping",
    "a link's motion is damped": "link/*/damping",
    "a body has no gravity": "body/*/gravity",
    "a link has no gravity": "link/*/gravity",
    "a body does not collide": "body/*/touches",
    "a link does not collide": "link/*/touches",
    "a body is kinematic or held": "body/*/dynamic",
    "a body's centre of mass is off": "body/*/com",
    "a joint has friction": "joint/*/friction",
    "the ground is 10 mm higher": "ground/height",
    "the step is another one": "timestep",
    "the fingers are not coupled": "gripper/coupled",
}

MEASURED = {
    "gravity": "free_fall",
    "timestep": "free_fall",
    "gripper/coupled": "fingers_stay_coupled",
    "ground/friction": "slides_above_mu",
    "*/restitution": "bounces_as_restitution_says",
    "*/margin": "links_are_felt",
    "body/*/damping": "damps_as_the_scene_says",
    "link/*/damping": "limp_arm_falls",
    "body/*/velocity": "thrown_as_the_scene_says",
    "body/*/gravity": "every_body_falls",
    "link/*/gravity": "limp_arm_falls",
    "body/*/touches": "tower_stands",
    "link/*/touches": "links_are_felt",
    "body/*/dynamic": "every_body_falls",
    "joint/*/friction": "limp_arm_falls",
    "joint/*finger*/effort_limit": "squeeze_bounds_the_grip",
    "joint/*/effort_limit": "every_effort_limit_counts",
}
"""The law of the kit that measures a quantity which an engine does not tell, first match."""


HAS_NONE = (" has no ", " have no ", "neither ")
"""In a deviation's reason: the engine lacks the thing, so it cannot be wrong there."""


def silent(subject: Subject, quantity: str) -> str:
    """What stands for a quantity that an adapter declares not to be told."""
    reason = next(d.reason for d in subject.cls.info.deviations if d.excuses(quantity))
    if any(words in reason for words in HAS_NONE):
        return "has none"
    name = next(name for pattern, name in MEASURED.items() if fnmatchcase(quantity, pattern))
    return f"`{CHECKS[name].name}`"


def cells(subject: Subject) -> dict[str, str]:
    """What finds each of the faults, by its name."""
    print(subject.name, file=sys.stderr, flush=True)
    return {
        name: cell(subject, fault, found)
        for faults in rounds()
        for found in [planted(subject, faults.values())]
        for name, fault in faults.items()
    }


def cell(subject: Subject, fault: Fault, found: ParityResult) -> str:
    if fault.quantity in found.wrong:
        return "parity"
    return silent(subject, fault.quantity) if fault.quantity in found.untold else "**missed**"


TOLD_AS_LOADED = {("pybullet", "joint/*/friction"): "`limp_arm_falls`"}
"""Told by the engine, but not when it changes after loading."""


def looked_up(subject: Subject, quantity: str) -> str:
    if (subject.name, quantity) in TOLD_AS_LOADED:
        return TOLD_AS_LOADED[subject.name, quantity]
    example = quantity.replace("*", "x")
    deviations = subject.cls.info.deviations
    untold = any(d.within is None and d.excuses(example) for d in deviations)
    return silent(subject, example) if untold else "parity"


def table(names: list[str]) -> list[str]:
    subjects = [Subject(adapter(name)) for name in names]
    rows = [["planted fault", *names]]
    found = [cells(subject) for subject in subjects]
    for name, fault in FAULTS.items():
        rows.append([fault.what, *(column[name] for column in found)])
    for what, quantity in IN_THE_ENGINE.items():
        rows.append([what, *(looked_up(s, quantity) for s in subjects)])
    rows.insert(1, ["---"] * len(rows[0]))
    return [f"| {' | '.join(row)} |" for row in rows]


def main() -> None:
    names = sys.argv[1:] or [name for name in registered() if not missing(adapter(name).info)]
    text = PAGE.read_text("utf-8")
    before, _, rest = text.partition("<!-- table -->\n")
    _, _, after = rest.partition("<!-- end -->")
    lines = "\n".join(table(names))
    PAGE.write_text(f"{before}<!-- table -->\n{lines}\n<!-- end -->{after}", "utf-8")


if __name__ == "__main__":
    main()
