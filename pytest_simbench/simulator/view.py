"""Where pictures are taken from: the same place for every engine, so that they can be compared."""

from __future__ import annotations

import math

from pytest_simbench.scene import Vector3

EYE: Vector3 = (2.0, -2.1, 1.35)
"""Of the camera, in the world [m]: the robot stands on the left, what it throws comes nearer on the
right."""

LOOK_AT: Vector3 = (0.6, 0.0, 0.5)
"""The middle of the picture, in the world [m]; z is up."""

FIELD_OF_VIEW = math.radians(40.0)
"""Vertical [rad]."""
