"""Where pictures are taken from: the same place for every engine, so that they can be compared."""

from __future__ import annotations

import math

from pytest_simbench.scene import Vector3

EYE: Vector3 = (1.1, -2.6, 1.25)
"""Of the camera, in the world [m]: beside the table, the robot on the left, what it throws flies to
the right."""

LOOK_AT: Vector3 = (0.6, 0.0, 0.45)
"""The middle of the picture, in the world [m]; z is up."""

FIELD_OF_VIEW = math.radians(40.0)
"""Vertical [rad]."""
