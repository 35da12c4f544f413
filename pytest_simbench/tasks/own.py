"""A task for one repetition. What its policies gather in one is not in the next, and others may be
under way."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from contextlib import suppress
from copy import copy, deepcopy
from functools import partial, update_wrapper
from types import CellType, FunctionType, MethodType
from typing import Any

import numpy as np

from pytest_simbench.tasks.base import Task
from pytest_simbench.tasks.source import is_own, package

KEPT = list, dict, set, deque
"""What a policy changes in place while it acts."""

CODE = FunctionType, MethodType, partial
"""What holds such things without being one: functions enclose them, methods are bound to them."""

BASES = {"abc", "builtins", "pytest_simbench", "typing"}
"""Packages whose classes an object of the user's may inherit from; else it may be a network."""

Known = dict[int, Any]
"""What is copied already, by the identity of what it is a copy of, as of `deepcopy`."""


def own(task: Task) -> Task:
    """The task with copies of the policies that it holds."""
    held = getattr(task, "__dict__", {})
    acting = {k: one for k, one in held.items() if callable(one) or hasattr(one, "act")}
    if not acting:
        return task
    mine = copy(task)
    known = {id(value): value for name, value in held.items() if name not in acting}
    known[id(task)] = mine  # what the task shares with a policy it goes on sharing
    vars(mine).update({name: _copied(policy, known) for name, policy in acting.items()})
    return mine


def _copied(policy: Any, known: Known) -> Any:
    """With objects of the user's classes, arrays, lists and dicts of its own; a network, or what
    cannot be copied, is shared, and so are arrays of which one is a view of another."""
    if id(policy) in known:
        return known[id(policy)]
    if isinstance(policy, MethodType):
        return MethodType(policy.__func__, _copied(policy.__self__, known))
    if isinstance(policy, partial):
        function, *given = _held([policy.func, *policy.args], known)
        return partial(function, *given, **_named(policy.keywords, known))
    if isinstance(policy, FunctionType):
        return _function(policy, known)
    mine = policy
    with suppress(Exception):
        mine = known[id(policy)] = copy(policy)
    if mine is not policy and hasattr(mine, "__dict__"):
        vars(mine).update(_named(vars(mine), known))
    return mine


def _function(function: FunctionType, known: Known) -> FunctionType:
    """With variables of its own, which it shares with copies of the functions around it."""
    cells = function.__closure__ or ()
    new = [cell for cell in cells if id(cell) not in known]
    known |= {id(cell): CellType() for cell in new}
    inner = tuple(known[id(cell)] for cell in cells)
    mine = FunctionType(function.__code__, function.__globals__, closure=inner)
    known[id(function)] = update_wrapper(mine, function)
    mine.__defaults__ = tuple(_held(function.__defaults__ or (), known))
    mine.__kwdefaults__ = _named(function.__kwdefaults__ or {}, known)
    full = [cell for cell in new if cell != CellType()]
    for cell, value in zip(full, _held([cell.cell_contents for cell in full], known), strict=True):
        known[id(cell)].cell_contents = value
    return mine


def _named(values: Mapping[str, Any], known: Known) -> dict[str, Any]:
    return dict(zip(values, _held(values.values(), known), strict=True))


def _held(values: Iterable[Any], known: Known) -> list[Any]:
    """Each of them, or a copy if it changes."""
    found = list(values)
    arrays = [value for value in found if isinstance(value, np.ndarray)]
    linked = any(one.base is other for one in arrays for other in arrays)
    for k, value in enumerate(found):
        with suppress(Exception):
            if isinstance(value, CODE) or _users(type(value)):
                found[k] = _copied(value, known)
            elif isinstance(value, KEPT if linked else (*KEPT, np.ndarray)):
                found[k] = deepcopy(value, known)
    return found


def _users(kind: type) -> bool:
    """Whether a class is the user's, and so is what it inherits: a filter, a controller. What ends
    something when it is deleted, a connection, is not copied."""
    bases = (is_own(base) or package(base) in BASES for base in kind.__mro__)
    return is_own(kind) and all(bases) and not hasattr(kind, "__del__")
