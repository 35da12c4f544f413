"""What a class or a function is: its source, and what it takes from elsewhere.

Whoever edits a policy or a task edits one of these: the functions and classes that it uses of the
user's own files, and the data that it reads there.
"""

from __future__ import annotations

import ast
import dis
import inspect
import sys
import textwrap
from contextlib import suppress
from functools import cached_property, lru_cache
from pathlib import Path, PurePath
from threading import Lock
from types import CodeType, ModuleType
from typing import Any

STANDARD = {__name__.partition(".")[0], *sys.stdlib_module_names}
"""Packages that records name with their versions."""

NEAR = 4
"""Folders from that of the code upwards: paths in them are told from there."""

_PARSING = Lock()
"""To find a class in its file means to parse it, which fails in two threads at once (CPython issue
106905): one of 1400 pushes side by side ended so."""


def package(made: Any) -> str:
    """The package of a module, class or function."""
    name = made.__name__ if isinstance(made, ModuleType) else getattr(made, "__module__", "")
    return str(name).partition(".")[0]


def is_own(made: Any) -> bool:
    """Whether a module, class or function is the user's: neither ours, nor Python's, nor
    installed."""
    module = made if isinstance(made, ModuleType) else sys.modules.get(str(made.__module__))
    file = getattr(module, "__file__", None) or ""
    installed = {"site-packages", "dist-packages"} & {*Path(file).parts}
    return not (installed or package(made) in STANDARD)


@lru_cache(maxsize=1024)
def text_of(part: Any) -> str:
    """The source of a class or a function as Python lays it out, without comments; its code where
    the source does not tell it; and versions, where it or what it inherits from is installed."""
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
    parts = getattr(part, "__mro__", [part])
    for name in dict.fromkeys(package(one) for one in parts if not is_own(one)):
        if name not in STANDARD:
            text += f"{name} {getattr(sys.modules.get(name), '__version__', '')}"
    return text


def taken_by(part: Any) -> dict[str, Any]:
    """What a class holds, its functions as they were written, and which of the user's classes it
    inherits from; what a function's code names of its module and of modules of the user's, and what
    it has of the function that made it."""
    if isinstance(part, type):
        found = {name: bare(value) for name, value in vars(part).items()}
        public = {} if text_of(part) else {k: v for k, v in found.items() if not k.startswith("_")}
        code = {k: v for k, v in found.items() if inspect.isfunction(v) or isinstance(v, type)}
        return public | code | {f"base {b.__qualname__}": b for b in part.__mro__[1:] if is_own(b)}
    names = {name for code in _codes(part.__code__) for name in code.co_names}
    found, spaces = {}, [part.__globals__]
    for space in spaces:
        for name in sorted(name for name in names & space.keys() if not name.startswith("__")):
            value = space[name]
            if not isinstance(value, ModuleType):
                found[_key(space, name)] = _placed(bare(value), space)
            elif is_own(value) and not any(vars(value) is known for known in spaces):
                spaces.append(vars(value))
    with suppress(ValueError):
        own = inspect.getclosurevars(part).nonlocals
        found |= {f"{part.__qualname__} {name}": bare(value) for name, value in own.items()}
    return found


def assigned_by(part: Any) -> set[str]:
    """Keys of `taken_by` to which a function assigns: a cache, a counter."""
    if isinstance(part, type):
        return set()
    instructions = (one for code in _codes(part.__code__) for one in dis.get_instructions(code))
    stored = (one.argval for one in instructions if one.opname == "STORE_GLOBAL")
    return {_key(part.__globals__, name) for name in stored}


def bare(value: Any) -> Any:
    """The function in a method, a property, a memory of results."""
    if isinstance(value, property | cached_property):
        value = value.fget if isinstance(value, property) else value.func
    if isinstance(value, staticmethod | classmethod):
        value = value.__func__
    while not inspect.isfunction(value) and inspect.isfunction(getattr(value, "__wrapped__", None)):
        value = value.__wrapped__
    return value


def _key(space: dict[str, Any], name: str) -> str:
    return f"{space.get('__name__', '')}.{name}"


def _placed(value: Any, space: dict[str, Any]) -> Any:
    """A path near the code as seen from there: another machine has both elsewhere."""
    text = str(value) if isinstance(value, PurePath | str) else ""
    folder = Path(space.get("__file__") or "/").parent
    for up, parent in enumerate([folder, *folder.parents][:NEAR]):
        if text == str(parent) or text.startswith(f"{parent}/".replace("//", "/")):
            return f"{up} {text.removeprefix(str(parent))}"
    return value


def _codes(code: CodeType) -> list[CodeType]:
    """Of a function and of what is written in it."""
    inner = filter(inspect.iscode, code.co_consts)
    return [code, *(each for one in inner for each in _codes(one))]


def _constant(value: Any) -> Any:
    if isinstance(value, frozenset):  # in another order in each process
        return sorted(map(repr, value))
    return None if inspect.iscode(value) else value
