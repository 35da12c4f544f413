"""What records say of a value that a task holds; an object is told by a digest, the same in each
process.

Objects change while they act (a filter, a counter). So one that is held counts as it was when this
process saw it first, and a policy's own numbers, texts, lists and arrays as they are.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import re
import sys
import weakref
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import lru_cache, partial
from logging import Logger
from pathlib import PurePath
from threading import Lock
from types import ModuleType
from typing import Any

import numpy as np

from pytest_simbench.records.record import plain
from pytest_simbench.scene.policy import Function, name_of
from pytest_simbench.worker.wire import pack

DEPTH = 10
"""Objects in objects that are looked into."""

WEIGHTS = 1000
"""So many of an array's numbers at most are looked at, evenly spread: networks are large."""

NAMED = ModuleType | type | Logger
"""What is told by its name alone."""

_PARSING = Lock()
"""To find a class in its file means to parse it, which fails in two threads at once (CPython issue
106905): one of 1400 pushes side by side ended so."""

_first: dict[int, tuple[weakref.ref[Any], str]] = {}
"""Digests of objects, by identity."""

Known = dict[int, tuple[Any, str]]
"""Objects of one digest, by identity, and their own digests; empty while they are looked into."""


def recorded(value: Any) -> Any:
    """A value as records hold it; an object by its name and digest."""
    if is_dataclass(value) and not isinstance(value, type):
        held = {item.name: getattr(value, item.name) for item in fields(value)}
        own = _package(type(value)) != _package(recorded)
        value = held | ({type(value).__name__: _at_first(value)} if own else {})
    if isinstance(value, Mapping):
        return {key: recorded(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [recorded(item) for item in value]
    if isinstance(value, set | frozenset):
        return sorted(str(recorded(item)) for item in value)
    if isinstance(value, str | int | float | None):
        return value
    if isinstance(value, PurePath | np.generic):
        return plain(value)
    return f"{name_of(value)} {_at_first(value)}"


def digest(policy: Any, known: Known | None = None, depth: int = DEPTH) -> str:
    """Of a policy's source and of what it holds."""
    text, held = [name_of(policy)], _attributes(policy)
    made = held.pop("_act") if isinstance(policy, Function) else policy
    while isinstance(made, partial):
        held |= {f"argument {k}": value for k, value in enumerate(made.args)} | made.keywords
        made = made.func
    held |= _attributes(getattr(made, "__self__", made))  # of a method, an object
    with suppress(TypeError, ValueError):
        held |= inspect.getclosurevars(made).nonlocals
        held |= {"defaults": made.__defaults__, "keywords": made.__kwdefaults__}
    text += _source(inspect.unwrap(made) if inspect.isroutine(made) else type(made))
    if not hasattr(made, "__dict__"):  # a date, say
        text.append(re.sub("( at)? 0x[0-9a-fA-F]+", "", repr(made)))
    for name, value in sorted(held.items()):
        if value is not None:
            text.append(f"{name}={_packed(value, known, depth)!r}")
    return _short(text)


def code_of(task: Any) -> str:
    """A digest of a task's source; empty for one of this package, whose version says it."""
    kind = type(task)
    return "" if _package(kind) == _package(recorded) else _short(_source(kind))


def _short(text: Iterable[str]) -> str:
    return hashlib.sha256("\n".join(text).encode()).hexdigest()[:16]


def _source(written: Any) -> list[str]:
    """Of a class, with those that it inherits from and that come with neither Python nor this
    package, or of a function."""
    known = {_package(recorded), *sys.stdlib_module_names}
    parts = written.__mro__ if isinstance(written, type) else [written]
    of = [part for part in parts if part is written or _package(part) not in known]
    return [line for part in of for line in _code(part)]


def _at_first(value: Any) -> str:
    """The digest of an object as it was when it was seen first."""
    seen, found = _first.get(id(value), (None, ""))
    if seen is None or seen() is not value:
        found = digest(value, {id(value): (value, "")})
        with suppress(TypeError):  # there are objects without weak references
            _first[id(value)] = weakref.ref(value), found
    return found


def _attributes(value: Any) -> dict[str, Any]:
    state = None if isinstance(value, NAMED) else object.__getstate__(value)
    own, slots = state if isinstance(state, tuple) else (state, {})
    return {**(own or {}), **slots}


def _package(made: Any) -> str:
    return str(getattr(made, "__module__", "")).partition(".")[0]


@lru_cache(maxsize=64)
def _code(written: Any) -> tuple[str, ...]:
    """The source of a class or a function, and numbers, texts, rows of them and functions that it
    takes from modules of its own package, as they were when it was seen first."""
    found: list[str] = []
    waiting = [written]
    for part in waiting:
        with suppress(OSError, TypeError), _PARSING:
            found.append(inspect.getsource(getattr(part, "__code__", part)))
        if getattr(part, "__name__", "") == "<lambda>":  # several may stand in one line
            code = part.__code__
            constants = [c for c in code.co_consts if not inspect.iscode(c)]
            found.append(f"{code.co_code.hex()} {code.co_names} {constants}")
        for function in filter(inspect.isfunction, [part, *getattr(part, "__dict__", {}).values()]):
            with suppress(TypeError, ValueError):
                for name, value in sorted(inspect.getclosurevars(function).globals.items()):
                    if isinstance(value, int | float | str | bytes):
                        found.append(f"{name}={value!r}")
                    elif isinstance(value, tuple | list | dict):
                        with suppress(TypeError, ValueError):  # it holds objects
                            found.append(f"{name}={json.dumps(value)}")
                    elif inspect.isfunction(value) and _package(value) == _package(written):
                        waiting += [value] * (value not in waiting)
    return tuple(found)


def _packed(value: Any, known: Known | None, depth: int) -> Any:
    """Plain data; objects by their digests."""
    if isinstance(value, NAMED):
        return name_of(value)
    if isinstance(value, dict):
        pairs = [[_packed(part, known, depth) for part in pair] for pair in value.items()]
        return {key if isinstance(key, str | int) else repr(key): item for key, item in pairs}
    if isinstance(value, list | tuple):
        return [_packed(item, known, depth) for item in value]
    if isinstance(value, set | frozenset):
        return sorted(repr(_packed(item, known, depth)) for item in value)
    array = isinstance(value, np.ndarray | np.generic) and not value.dtype.hasobject
    if array or isinstance(value, str | bytes | int | float | complex | None):
        return pack(value)
    if hasattr(type(value), "tolist") and hasattr(type(value), "reshape"):  # a network's weights
        flat = value.reshape(-1)
        seen = flat[:: 1 + len(flat) // WEIGHTS].tolist()
        return [*value.shape], _packed(seen, known, depth)
    if known is None:
        return _at_first(value)
    if id(value) not in known:
        known[id(value)] = value, ""  # a circle ends here
        known[id(value)] = value, digest(value, known, depth - 1) if depth else ""
    return known[id(value)][1]
