"""Pick a cube up and put it on a stand: over it, down, close, up, across, down, open, up."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pytest_simbench.suites.policies import Controller, Limp

from pytest_simbench.scene.policy import Command, Observation

OPEN = 0.08
"""Between the fingers [m]."""


class Pick(Controller):
    """Numbers: the tool comes from a height `over` [m], grasps at a height `grasp` [m], and is
    `closing` so long [s]; it carries the cube at a height `carry` [m], lets go `above` the place
    [m], and is `opening` so long [s]. It travels at the speed `free`, `carries` at another and
    moves up and `down` at a third [m/s], and goes on where it is `near` its target [m]."""

    task, body = "picking", "cube"
    bounds: ClassVar = {
        "over": (0.06, 0.15), "grasp": (0.005, 0.045), "closing": (0.1, 0.8), "carry": (0.08, 0.2),
        "above": (-0.01, 0.02), "opening": (0.1, 0.6), "free": (0.2, 1.2), "carries": (0.1, 1.2),
        "down": (0.05, 0.6), "near": (0.002, 0.03), "smoothing": (0.1, 1.0),
    }  # fmt: skip

    def reset(self, seed: int) -> None:
        super().reset(seed)
        self._phase, self._since = 0, 0.0

    def act(self, seen: Observation) -> Command:
        n, cube = self.numbers, self.look(seen)
        goal = np.array(seen.goal.position)
        tool = np.array(seen.tool.position)
        lower = goal[2] - 0.025 + n["grasp"] + n["above"]
        place = goal[:2]
        ways = (
            ((*cube, n["over"]), n["free"], OPEN, 0.0),
            ((*cube, n["grasp"]), n["down"], OPEN, 0.0),
            ((*tool[:2], n["grasp"]), n["down"], 0.0, n["closing"]),
            ((*tool[:2], n["carry"]), n["down"], 0.0, 0.0),
            ((*place, max(n["carry"], lower)), n["carries"], 0.0, 0.0),
            ((*place, lower), n["down"], 0.0, 0.0),
            ((*place, lower), n["down"], OPEN, n["opening"]),
            ((*place, lower + n["over"]), n["down"], OPEN, 60.0),
        )
        target, speed, width, seconds = ways[self._phase]
        if seconds:
            over = seen.time - self._since >= seconds - 1e-9
        else:
            over = float(np.linalg.norm(np.subtract(target, tool))) < n["near"]
        if over:  # the next way begins at once
            self._phase, self._since = self._phase + 1, seen.time
            target, speed, width, _ = ways[self._phase]
        return self.move(seen, target, speed, width)


SCRIPTED = {
    "over": 0.1, "grasp": 0.02, "closing": 0.4, "carry": 0.12, "above": 0.002, "opening": 0.3,
    "free": 0.5, "carries": 0.4, "down": 0.2, "near": 0.008, "smoothing": 0.5,
}  # fmt: skip

TRAINED: dict[str, dict] = {
    "mujoco-0": {
        "sim": "mujoco", "seeds": (900000, 900019), "sets": (4, 12, 5), "date": "2026-11-25",
        "numbers": (
            0.1051, 0.02327, 0.6128, 0.1428, 0.006208, 0.3625,
            1.063, 0.4612, 0.345, 0.01054, 0.8328,
        ),
    },
    "pybullet-0": {
        "sim": "pybullet", "seeds": (900000, 900019), "sets": (4, 12, 5), "date": "2026-11-25",
        "numbers": (
            0.121, 0.02889, 0.2877, 0.1161, -0.001892, 0.2694,
            0.9074, 0.9063, 0.1936, 0.003019, 0.6856,
        ),
    },
    "sapien-0": {
        "sim": "sapien", "seeds": (900000, 900019), "sets": (4, 12, 5), "date": "2026-11-25",
        "numbers": (
            0.104, 0.02392, 0.5239, 0.1393, 0.0006223, 0.1957,
            1.069, 0.9764, 0.2933, 0.004203, 0.5429,
        ),
    },
}  # fmt: skip
"""What `train.py` found, by engine (profile `tuned`) and its own seed: in so many generations of so
many sets of numbers in so many episodes each, of these seeds."""

policies = {
    **{name: Pick(name, found["numbers"]) for name, found in TRAINED.items()},
    "scripted": Pick("scripted", SCRIPTED.values()),
    "limp": Limp(Pick.task),
}
