"""What records say of a value that a task holds; an object is told by a digest, the same in each
process.

Objects change while they act (a filter, a counter). So one that is held counts as it was when this
process saw it first, and a policy's own numbers, texts, lists and arrays as they are.
"""

from __future__ import annotations

import ast
import hashlib
import inspect
import re
import sys
import textwrap
import weakref
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import cached_property, lru_cache, partial
from logging import Logger
from pathlib import Path, PurePath
from threading import Lock
from types import CodeType, ModuleType
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
    text += _source(inspect.unwrap(made) if inspect.isroutine(made) else type(made), depth)
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


def _source(written: Any, depth: int = DEPTH) -> list[str]:
    """Of a class, with those that it inherits from and that come with neither Python nor this
    package, or of a function."""
    known = {_package(recorded), *sys.stdlib_module_names}
    parts = written.__mro__ if isinstance(written, type) else [written]
    of = [part for part in parts if part is written or _package(part) not in known]
    return [line for part in of for line in _code(part, depth)]


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


@lru_cache(maxsize=256)
def _code(written: Any, depth: int) -> tuple[str, ...]:
    """The source of a class or a function, and what it takes from modules: data, objects, and code
    of the user's, as they were when it was seen first; of what is installed its version."""
    if not _is_own(written):
        version = getattr(sys.modules.get(_package(written)), "__version__", "")
        return _text(written), str(version)
    found: list[str] = []
    waiting, known = [written], Known()
    for part in waiting:
        found.append(_text(part))
        for name, value in sorted((_members if isinstance(part, type) else _taken)(part).items()):
            value = inspect.unwrap(value) if callable(value) else value
            if inspect.isfunction(value) or isinstance(value, type):
                waiting += [value] * (_is_own(value) and value not in waiting)
            elif depth and not (inspect.isbuiltin(value) or isinstance(value, NAMED)):
                with suppress(Exception):  # objects of others raise what they like
                    found.append(f"{name}={_packed(value, known, depth - 1)!r}")
    return tuple(found)


def _text(part: Any) -> str:
    """Its source as Python lays it out, without comments; where that does not tell it, the code."""
    code = getattr(part, "__code__", None)
    if code and code.co_filename == "<string>" and code.co_name.startswith("__"):
        return ""  # a dataclass makes it of its fields
    text = ""
    with suppress(OSError, TypeError, SyntaxError), _PARSING:
        text = inspect.getsource(code or part)
        text = ast.unparse(ast.parse(textwrap.dedent(text)))
    if code and (not text or code.co_name == "<lambda>"):  # several may stand in one line
        text += "".join(
            f"{one.co_code.hex()} {one.co_names} {[_constant(c) for c in one.co_consts]}"
            for one in _codes(code)
        )
    return text


def _codes(code: CodeType) -> list[CodeType]:
    """Of a function and of what is written in it."""
    inner = filter(inspect.iscode, code.co_consts)
    return [code, *(each for one in inner for each in _codes(one))]


def _constant(value: Any) -> Any:
    if isinstance(value, frozenset):  # in another order in each process
        return sorted(map(repr, value))
    return None if inspect.iscode(value) else value


def _members(kind: type) -> dict[str, Any]:
    """What a class holds, its functions as they were written."""
    found: dict[str, Any] = {}
    for name, value in vars(kind).items():
        if isinstance(value, staticmethod | classmethod):
            value = value.__func__
        elif isinstance(value, property | cached_property):
            value = value.fget if isinstance(value, property) else value.func
        if callable(value) or not name.startswith("_"):
            found[name] = value
    return found


def _taken(function: Any) -> dict[str, Any]:
    """What a function's code names: of its module, of modules of the user's, and of functions that
    it was made in."""
    if not inspect.isfunction(function):
        return {}
    names = {name for code in _codes(function.__code__) for name in code.co_names}
    space = function.__globals__
    found = {name: space[name] for name in names if name in space}
    for module in [m for m in found.values() if isinstance(m, ModuleType) and _is_own(m)]:
        found |= {f"{module.__name__}.{n}": getattr(module, n) for n in names if hasattr(module, n)}
    with suppress(ValueError):
        found |= inspect.getclosurevars(function).nonlocals
    return found


def _is_own(made: Any) -> bool:
    """Whether a module, class or function is the user's: neither ours, nor Python's, nor
    installed."""
    name = made.__name__ if isinstance(made, ModuleType) else str(made.__module__)
    file = getattr(sys.modules.get(name), "__file__", None) or ""
    installed = {"site-packages", "dist-packages"} & {*Path(file).parts}
    known = {_package(recorded), *sys.stdlib_module_names}
    return not (installed or name.partition(".")[0] in known)


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
    if isinstance(value, PurePath):
        return str(value).removeprefix(f"{Path.cwd()}/")
    if known is None:
        return _at_first(value)
    if id(value) not in known:
        known[id(value)] = value, ""  # a circle ends here
        known[id(value)] = value, digest(value, known, depth - 1) if depth else ""
    return known[id(value)][1]
