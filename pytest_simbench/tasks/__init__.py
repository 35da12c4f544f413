"""The tasks: scene, procedure and score, the same for every simulator."""

from pytest_simbench.tasks.base import Jitter, Outcome, Task
from pytest_simbench.tasks.stacking import Stacking
from pytest_simbench.tasks.throwing import Throwing

__all__ = ["Jitter", "Outcome", "Stacking", "Task", "Throwing"]
