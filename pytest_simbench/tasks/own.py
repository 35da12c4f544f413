"""A task for one repetition. What its policies gather in one is not in the next, and others may be
under way."""

from __future__ import annotations

from collections import deque
from contextlib import suppress
from copy import copy, deepcopy
from types import MethodType
from typing import Any

import numpy as np

from pytest_simbench.tasks.base import Task

KEPT = list, dict, set, deque, MethodType
"""What a policy changes in place while it acts. A method changes what it is bound to."""


def own(task: Task) -> Task:
    """The task with copies of the policies that it holds."""
    held = getattr(task, "__dict__", {})
    acting = {k: one for k, one in held.items() if callable(one) or hasattr(one, "act")}
    if not acting:
        return task
    mine = copy(task)
    vars(mine).update({name: _copied(policy) for name, policy in acting.items()})
    return mine


def _copied(policy: Any) -> Any:
    """With arrays, lists and dicts of its own; a network, or what cannot be copied, is shared, and
    so are arrays of which one is a view of another."""
    own = copy(policy)  # a function is not copied
    held, known = {} if own is policy else getattr(own, "__dict__", {}), {id(policy): own}
    arrays = [value for value in held.values() if isinstance(value, np.ndarray)]
    linked = any(one.base is other for one in arrays for other in arrays)
    for name, value in held.items():
        if isinstance(value, KEPT if linked else (*KEPT, np.ndarray)):
            with suppress(Exception):
                held[name] = deepcopy(value, known)
    return own
