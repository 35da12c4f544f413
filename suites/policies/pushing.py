"""Push a block to its goal: get behind it, come down, push towards the goal, and let go there."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pytest_simbench.suites.policies import Controller, Limp

from pytest_simbench.scene.policy import Command, Observation

HIGH = 0.12
"""Of the tool above the ground where it travels [m]."""


class Push(Controller):
    """Numbers: the hand comes down so far `behind` the block's centre [m], and pushes at a `height`
    [m] at a `speed` [m/s], or `slow` [1/s] times what is left, and `gain` [1/s] times its distance
    from the line to the goal sideways; it lets go at a distance `stop` [m] from the goal, and
    starts again where it is `astray` [m] from the line. It travels at the speed `free` [m/s]."""

    task, body = "pushing", "block"
    bounds: ClassVar = {
        "behind": (0.06, 0.10), "height": (0.008, 0.045), "speed": (0.03, 0.3),
        "slow": (0.5, 5.0), "gain": (0.0, 6.0), "stop": (0.001, 0.02), "astray": (0.01, 0.05),
        "free": (0.2, 1.0), "smoothing": (0.1, 1.0),
    }  # fmt: skip

    def reset(self, seed: int) -> None:
        super().reset(seed)
        self._done = False

    def act(self, seen: Observation) -> Command:
        n, block = self.numbers, self.look(seen)
        tool = np.array(seen.tool.position)
        way = np.array(seen.goal.position[:2]) - block
        left = float(np.linalg.norm(way))
        ahead = way / max(left, 1e-9)
        sideways = np.array([-ahead[1], ahead[0]])
        off = tool[:2] - block
        self._done = left < n["stop"] + (0.015 if self._done else 0.0)
        up = self.move(seen, (tool[0], tool[1], HIGH), n["free"])
        if self._done:
            return up
        if tool[2] > n["height"] + 0.02:
            place = block - n["behind"] * ahead
            if np.linalg.norm(tool[:2] - place) < 0.01:
                return self.move(seen, (*place, n["height"]), n["free"])
            return up if tool[2] < HIGH - 0.03 else self.move(seen, (*place, HIGH), n["free"])
        if abs(off @ sideways) > n["astray"] or off @ ahead > 0.0:
            return up
        speed = min(n["speed"], n["slow"] * left) * ahead - n["gain"] * (off @ sideways) * sideways
        target = tool[:2] + speed / self.rate
        return self.move(seen, (*target, n["height"]), n["free"])


SCRIPTED = {
    "behind": 0.075, "height": 0.03, "speed": 0.1, "slow": 1.5, "gain": 1.0, "stop": 0.005,
    "astray": 0.03, "free": 0.4, "smoothing": 0.5,
}  # fmt: skip

TRAINED: dict[str, dict] = {
    "mujoco-0": {
        "sim": "mujoco", "seeds": (900000, 900063), "sets": (8, 16, 8), "date": "2026-11-25",
        "numbers": (0.07721, 0.03771, 0.253, 3.707, 0.841, 0.01032, 0.03606, 0.7683, 0.553),
    },
    "mujoco-1": {
        "sim": "mujoco", "seeds": (910000, 910035), "sets": (6, 16, 6), "date": "2026-11-25",
        "numbers": (0.08431, 0.02934, 0.1949, 3.458, 0.8193, 0.008832, 0.03611, 0.7544, 0.5764),
    },
    "pybullet-0": {
        "sim": "pybullet", "seeds": (900000, 900035), "sets": (6, 16, 6), "date": "2026-11-25",
        "numbers": (0.07718, 0.03186, 0.1464, 4.892, 3.713, 0.008343, 0.01845, 0.6669, 0.6885),
    },
    "pybullet-1": {
        "sim": "pybullet", "seeds": (910000, 910005), "sets": (1, 12, 6), "date": "2026-11-25",
        "numbers": (0.07719, 0.02968, 0.1765, 3.595, 2.636, 0.007301, 0.0339, 0.6648, 0.5983),
    },
    "ode-0": {
        "sim": "ode", "seeds": (900000, 900005), "sets": (1, 16, 6), "date": "2026-11-25",
        "numbers": (0.07619, 0.03102, 0.2054, 2.75, 4.29, 0.01185, 0.02733, 0.5547, 0.6807),
    },
    "drake-0": {
        "sim": "drake", "seeds": (900000, 900035), "sets": (6, 12, 6), "date": "2026-11-25",
        "numbers": (0.07608, 0.01668, 0.1801, 4.493, 3.614, 0.007262, 0.04267, 0.7745, 0.6624),
    },
    "sapien-0": {
        "sim": "sapien", "seeds": (900000, 900035), "sets": (6, 16, 6), "date": "2026-11-25",
        "numbers": (0.07606, 0.03246, 0.2454, 3.343, 4.954, 0.007118, 0.02972, 0.4992, 0.7583),
    },
    "sapien-1": {
        "sim": "sapien", "seeds": (910000, 910035), "sets": (6, 16, 6), "date": "2026-11-25",
        "numbers": (0.0747, 0.02701, 0.121, 2.965, 1.104, 0.003529, 0.03783, 0.4902, 0.4969),
    },
}  # fmt: skip
"""What `train.py` found, by engine (profile `tuned`) and its own seed: in so many generations of so
many sets of numbers in so many episodes each, of these seeds."""

policies = {
    **{name: Push(name, found["numbers"]) for name, found in TRAINED.items()},
    "scripted": Push("scripted", SCRIPTED.values()),
    "limp": Limp(Push.task),
}
