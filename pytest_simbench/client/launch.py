"""What a worker is started with, and what it says of the simulator that it made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Launch:
    """How to start a worker.

    Attributes:
        adapter: `module:Class` of the simulator's adapter.
        python: interpreter, None for pytest's own.
        spec: whole execnet specification, which overrides `python` (another host).
        environment: variables set in the worker's environment.
        log: file that takes all of the worker's output, None to leave it alone.
        start_timeout: for interpreter start and handshake, each [s].
        stall_timeout: longest silence before the worker counts as hung [s].
        compile_timeout: for `Simulator.compile` [s], if that is longer; 0 where there is nothing
            to compile.
    """

    adapter: str
    python: str | None = None
    spec: str | None = None
    environment: Mapping[str, str] = field(default_factory=dict)
    log: Path | None = None
    start_timeout: float = 60.0
    stall_timeout: float = 60.0
    compile_timeout: float = 0.0


@dataclass(frozen=True)
class Constructed:
    """A simulator that a worker made.

    Attributes:
        settings: all of them, by name.
        versions: of the packages that it runs on, by name.
        untested: why this is no version that the adapter was tested with; empty if it is one.
    """

    settings: Mapping[str, Any] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    untested: str = ""
