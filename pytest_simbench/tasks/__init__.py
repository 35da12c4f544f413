"""The tasks: scene, procedure and score, the same for every simulator."""

from pytest_simbench.tasks.arm_following import ArmFollowing, CorrectedArmFollowing
from pytest_simbench.tasks.arm_pushing import ArmPushing
from pytest_simbench.tasks.base import Jitter, Outcome, Task
from pytest_simbench.tasks.moments import Moment
from pytest_simbench.tasks.pushing import CurvePushing, Pushing
from pytest_simbench.tasks.stacking import Stacking
from pytest_simbench.tasks.throwing import Throwing
from pytest_simbench.tasks.tossing import Tossing
from pytest_simbench.tasks.towers import LeaningTowers

__all__ = [
    "ArmFollowing",
    "ArmPushing",
    "CorrectedArmFollowing",
    "CurvePushing",
    "Jitter",
    "LeaningTowers",
    "Moment",
    "Outcome",
    "Pushing",
    "Stacking",
    "Task",
    "Throwing",
    "Tossing",
]
