"""The tasks: scene, procedure and score, the same for every simulator.

Each is imported when it is asked for: planners are large, and who reads records needs none.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pytest_simbench.tasks.arm_following import ArmFollowing, CorrectedArmFollowing
    from pytest_simbench.tasks.arm_pushing import ArmPushing
    from pytest_simbench.tasks.base import Jitter, Moment, Outcome, Task
    from pytest_simbench.tasks.carrying import Carrying, Slipping
    from pytest_simbench.tasks.fitting import Fitting
    from pytest_simbench.tasks.goals import GoalTask, PickAndPlace, PushingToGoal, Reaching
    from pytest_simbench.tasks.holding import Holding
    from pytest_simbench.tasks.impacting import Impacting
    from pytest_simbench.tasks.inserting import Inserting, Oversized
    from pytest_simbench.tasks.nesting import Nesting
    from pytest_simbench.tasks.opening import Opening
    from pytest_simbench.tasks.pouring import Pouring
    from pytest_simbench.tasks.pushing import CurvePushing, Pushing
    from pytest_simbench.tasks.replaying import Log, Replaying
    from pytest_simbench.tasks.settling import Settling, rests_on
    from pytest_simbench.tasks.stacking import Stacking
    from pytest_simbench.tasks.throwing import Throwing
    from pytest_simbench.tasks.tossing import Tossing
    from pytest_simbench.tasks.towers import LeaningTowers

__all__ = [
    "ArmFollowing", "ArmPushing", "Carrying", "CorrectedArmFollowing", "CurvePushing", "Fitting",
    "GoalTask", "Holding", "Impacting", "Inserting", "Jitter", "LeaningTowers", "Log", "Moment",
    "Nesting", "Opening", "Outcome", "Oversized", "PickAndPlace", "Pouring", "Pushing",
    "PushingToGoal", "Reaching", "Replaying", "Settling", "Slipping", "Stacking", "Task",
    "Throwing", "Tossing", "rests_on",
]  # fmt: skip

_MODULES = {
    "arm_following": ("ArmFollowing", "CorrectedArmFollowing"),
    "arm_pushing": ("ArmPushing",),
    "base": ("Jitter", "Moment", "Outcome", "Task"),
    "carrying": ("Carrying", "Slipping"),
    "fitting": ("Fitting",),
    "goals": ("GoalTask", "PickAndPlace", "PushingToGoal", "Reaching"),
    "holding": ("Holding",),
    "impacting": ("Impacting",),
    "inserting": ("Inserting", "Oversized"),
    "nesting": ("Nesting",),
    "opening": ("Opening",),
    "pouring": ("Pouring",),
    "pushing": ("CurvePushing", "Pushing"),
    "replaying": ("Log", "Replaying"),
    "settling": ("Settling", "rests_on"),
    "stacking": ("Stacking",),
    "throwing": ("Throwing",),
    "tossing": ("Tossing",),
    "towers": ("LeaningTowers",),
}


def __getattr__(name: str) -> Any:
    for module, names in _MODULES.items():
        if name in names:
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
