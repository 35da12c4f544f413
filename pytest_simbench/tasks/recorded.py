"""What records say of a value that a task holds; an object is told by a digest, the same in each
process.

Objects change while they act (a filter, a counter). So one that is held counts as it was when this
process saw it first, and a policy's own numbers, texts, lists and arrays as they are.
"""

from __future__ import annotations

import hashlib
import inspect
import re
import weakref
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import lru_cache, partial
from logging import Logger
from pathlib import Path, PurePath
from types import ModuleType
from typing import Any

import numpy as np

from pytest_simbench.records.record import plain
from pytest_simbench.scene.policy import Function, name_of
from pytest_simbench.tasks.source import assigned_by, bare, is_own, package, taken_by, text_of

DEPTH = 10
"""Objects in objects that are looked into."""

WEIGHTS = 1000
"""So many of an array's numbers at most are looked at, evenly spread: networks are large."""

NAMED = ModuleType | type | Logger
"""What is told by its name alone."""

_first: dict[int, tuple[weakref.ref[Any], str]] = {}
"""Digests of objects, by identity."""

Known = dict[int, tuple[Any, str]]
"""Objects of one digest, by identity, and their own digests; empty while they are looked into."""


class Objects(dict[int, tuple[Any, str]]):
    """The same, and classes and functions of theirs, without digests: they are looked at later."""


def recorded(value: Any) -> Any:
    """A value as records hold it; an object by its name and digest."""
    if is_dataclass(value) and not isinstance(value, type):
        held = {item.name: getattr(value, item.name) for item in fields(value)}
        own = package(type(value)) != package(recorded)
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
    """Of a policy's code and of what it holds."""
    text, held = [name_of(policy)], _attributes(policy)
    made = held.pop("_act") if isinstance(policy, Function) else policy
    while isinstance(made, partial):
        held |= {f"argument {k}": value for k, value in enumerate(made.args)} | made.keywords
        made = made.func
    owner = getattr(made, "__self__", made)  # of a method, an object
    held |= _attributes(owner)
    with suppress(TypeError, ValueError):
        held |= inspect.getclosurevars(made).nonlocals
        held |= {"defaults": made.__defaults__, "keywords": made.__kwdefaults__}
    written: list[Any] = [bare(made) if inspect.isroutine(made) else type(made)]
    if inspect.ismethod(made):
        written = [bare(made.__func__), owner if isinstance(owner, type) else type(owner)]
    if isinstance(known, Objects):
        known |= {id(one): (one, "") for one in written}
    else:
        text += [_code(one) for one in written]
    if not hasattr(made, "__dict__"):  # a date, say
        text.append(re.sub("( at)? 0x[0-9a-fA-F]+", "", repr(made)))
    for name, value in sorted(held.items()):
        if value is not None:
            text.append(f"{name}={_packed(value, known, depth)!r}")
    return _short(text)


def code_of(task: Any) -> str:
    """A digest of a task's code; empty for one of this package, whose version says it."""
    kind: Any = type(task)
    return "" if package(kind) == package(recorded) else _code(kind)


def _short(text: Iterable[str]) -> str:
    return hashlib.sha256("\n".join(text).encode()).hexdigest()[:16]


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


@lru_cache(maxsize=1024)
def _code(written: Any) -> str:
    """A digest of the code of a class or a function, and of what it takes from elsewhere: data,
    objects and other code of the user's, as they were when it was seen first."""
    texts: list[str] = []
    data: dict[str, str] = {}
    assigned: set[str] = set()
    waiting, known = [written], Objects()
    for part in waiting:
        texts.append(text_of(part))
        if not is_own(part):
            continue
        assigned |= assigned_by(part)
        used = []
        for name, value in sorted(taken_by(part).items()):
            if inspect.isfunction(value) or isinstance(value, type):
                used.append(value)
            elif not (inspect.isbuiltin(value) or isinstance(value, NAMED)):
                with suppress(Exception):  # objects of others raise what they like
                    data[name] = repr(_packed(value, known, DEPTH))
        used += [value for value, own in known.values() if not own]
        waiting += [one for one in dict.fromkeys(used) if is_own(one) and one not in waiting]
    kept = sorted(data.keys() - assigned)  # what it assigns to is no code
    return _short([*texts, *(f"{name}={data[name]}" for name in kept)])


def look_anew() -> None:
    """Forget the code that was seen: a cell of a notebook may have been run again."""
    _code.cache_clear()
    text_of.cache_clear()


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
    if isinstance(value, np.ndarray | np.generic) and not value.dtype.hasobject:
        data = hashlib.sha256(value.tobytes()).hexdigest()
        return value.dtype.str, *value.shape, data
    if isinstance(value, str | bytes | int | float | complex | None):
        return value
    if hasattr(type(value), "tolist") and hasattr(type(value), "reshape"):  # a network's weights
        flat = value.reshape(-1)
        seen = flat[:: 1 + len(flat) // WEIGHTS].tolist()
        return [*value.shape], _packed(seen, known, depth)
    if isinstance(value, PurePath):
        return str(value).removeprefix(f"{Path.cwd()}/")
    if known is None:
        return _at_first(value)
    if id(value) not in known:
        known[id(value)] = value, ""  # a circle ends here
        known[id(value)] = value, digest(value, known, depth - 1) if depth else ""
    return known[id(value)][1]
