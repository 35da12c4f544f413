"""Checks of `--sim-python` and `--sim-spec` before a worker is started with them."""

from __future__ import annotations

import os
import shlex
import shutil
from pathlib import Path
from typing import NoReturn

from pytest_simbench.cli.values import BadInput

TYPES = ("popen", "ssh", "socket", "vagrant_ssh")
"""Of gateways that a worker may be behind. execnet's `via` needs a second gateway beside it."""

KEYS = ("chdir", "dont_write_bytecode", "env:NAME", "execmodel", "nice", "python", "ssh_config")
"""What else execnet reads in a specification (`execnet.xspec.XSpec`); `id` is ours to give."""

MODELS = ("main_thread_only", "thread")
"""Execution models of execnet that are plain Python."""


def interpreter_path(text: str, where: str, here: Path) -> str:
    """The absolute path of an interpreter given as a path (`~` allowed) or by its name on PATH.

    A relative path begins `here`; `where` is option and value, for the message.

    Raises:
        BadInput: there is none, or it cannot be executed.
    """
    path = os.path.expanduser(text)
    if "/" not in path:
        found = shutil.which(path)
        if found is None:
            _refuse(where, "there is no such program on the PATH; give the interpreter's path")
        path = found
    # Not resolved: a virtual environment's interpreter is a link, and must be called as one.
    # execnet separates what it is told by //.
    path = "/" + os.path.normpath(Path(here, path)).lstrip("/")
    if os.path.isdir(path):
        python = Path(path, "bin", "python")
        hint = f", {python}" if python.exists() else ""
        _refuse(where, f"is a folder; give the interpreter in it{hint}")
    if not os.path.exists(path):
        _refuse(where, "there is no such file; give the path of a Python interpreter")
    if not os.access(path, os.X_OK):
        _refuse(where, "the file cannot be executed; give the path of a Python interpreter")
    return path


def checked_specification(text: str, where: str) -> str:
    """An execnet specification such as `ssh=host//python=/usr/bin/python3`.

    Raises:
        BadInput: execnet would not understand it; one sentence.
    """
    parts: dict[str, str] = {}
    for part in text.split("//"):
        key, equals, value = part.partition("=")
        if key in parts:
            _refuse(where, f"{key} is there twice")
        if key not in (*TYPES, *KEYS) and not (key.startswith("env:") and key != "env:"):
            _refuse(where, f"{key!r} is none of execnet's keys; choose from "
                    f"{', '.join((*TYPES, *KEYS))}, separated by //")  # fmt: skip
        bare = key in ("popen", "dont_write_bytecode")
        if bool(equals if bare else not value):
            _refuse(where, f"{key} takes {'no' if bare else 'a'} value")
        parts[key] = value
    kinds = [kind for kind in TYPES if kind in parts]
    if len(kinds) != 1:
        _refuse(where, f"give one of {', '.join(TYPES)}, as in ssh=HOST//python=/usr/bin/python3")
    if parts.get("execmodel", MODELS[0]) not in MODELS:
        _refuse(where, f"execmodel must be {' or '.join(MODELS)}")
    if not parts.get("nice", "0").removeprefix("-").isdecimal():
        _refuse(where, "nice takes a whole number")
    host, colon, port = parts.get("socket", "localhost:1").rpartition(":")
    if not (host and colon and port.isdecimal() and 0 < int(port[:6]) < 65536):
        _refuse(where, "socket takes HOST:PORT")
    if kinds == ["popen"] and "python" in parts:
        _check_command(parts["python"], where)
    return text


def _check_command(text: str, where: str) -> None:
    """`python=` of a worker on this machine: a command, which execnet splits like a shell."""
    try:
        program = shlex.split(text)[0]
    except (ValueError, IndexError):
        _refuse(where, "python= holds quotes that do not match")
    if shutil.which(program) is None:
        _refuse(where, f"there is no program {program} to be executed")


def _refuse(where: str, why: str) -> NoReturn:
    raise BadInput(f"{where}: {why}")
