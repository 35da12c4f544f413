"""Why a motion could not be planned, or a robot not be used."""

from __future__ import annotations


class RobotError(ValueError):
    """A robot that is not known, cannot be used, or cannot do what a task asks; one sentence."""


class PlanningError(Exception):
    """A motion that cannot be planned; the message is the counted reason of a failed pick."""


class Unreachable(PlanningError):
    """No joint position within the limits brings the tool to the pose."""
