"""Records of schema 1 (pytest-simbench 0.1) as those of today. The only place that takes ids apart.

There a test's function and variant stood in its id alone, and what the tool noted stood among the
task's details, where a task's own of the same name could be in its place: what is not of the type
that the tool writes is the task's.
"""

from __future__ import annotations

from typing import Any

from pytest_simbench.ground.versions import VersionedName
from pytest_simbench.records.checked import CheckError, convert
from pytest_simbench.records.notes import Notes

NOTED = {
    **{name: name for name in ("log", "closing", "untested", "filmed", "video", "trace")},
    **{name: name for name in ("left_out", "own_timestep", "chosen_on", "lost_nodes")},
    "data": "sample",
    "law": "reading",
}
"""Keys of the details of schema 1 that the tool wrote, and their names among the notes."""


def upgraded(data: dict[str, Any]) -> dict[str, Any]:
    """The plain data of a record of schema 1 as of schema 2; what is malformed stays as it is."""
    found = dict(data)
    if isinstance(details := data.get("details"), dict):
        found["details"], found["notes"] = _notes(details)
    texts = [data.get(key, "") for key in ("test", "simulator", "mode", "profile")]
    if all(isinstance(text, str) for text in texts):
        test, simulator, mode, profile = texts
        robot = data.get("robot")
        name = robot.get("name") if isinstance(robot, dict) else None
        function, variant = taken_apart(test, simulator, mode, profile, str(name or ""))
        found = {"function": function, "variant": variant, **found}
        found.setdefault("version", VersionedName.of(simulator).which)
    return found


def taken_apart(test: str, simulator: str, mode: str, profile: str, robot: str) -> tuple[str, str]:
    """Function and variant of a test's id."""
    function, _, parameters = test.partition("[")
    inside = "-" + parameters.removesuffix("]") + "-"
    before, ours, after = inside.partition(f"-{simulator}-{mode}-")
    if ours:
        for part in filter(None, (robot, profile)):
            after = after.removeprefix(f"{part}-")
        if after.startswith("dt="):
            after = after.partition("-")[2]
    return function, f"{before}-{after}".strip("-")


def _notes(details: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Details and notes of the details of schema 1."""
    ours: dict[str, Any] = {}
    for old, name in NOTED.items():
        if old in details and details[old] is not None:
            try:
                convert({name: details[old]}, Notes)
            except CheckError:
                continue
            ours[old] = details[old]
    left = {key: value for key, value in details.items() if key not in ours}
    return left, {NOTED[old]: value for old, value in ours.items()}
