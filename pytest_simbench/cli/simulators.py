"""`simbench list`: the known simulators, which are ready here, and how to get the others."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, suppress
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

from pytest_simbench.cli.names import read_names
from pytest_simbench.cli.values import BadInput
from pytest_simbench.client import environments
from pytest_simbench.client.errors import Where, WorkerError
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.experiment.case import Case
from pytest_simbench.ground.text import for_terminal
from pytest_simbench.report.model.capabilities import columns
from pytest_simbench.report.terminal.grid import aligned, fill, render
from pytest_simbench.simulator.registry import adapter, known, problem, registry
from pytest_simbench.simulator.settings import Settings, in_words, meanings, searched

Missing = Callable[[str], str | None]
"""Why a simulator whose adapter is fine cannot run, with what mends it; None when it can."""


def list_simulators(
    names: Sequence[str] = (),
    verbose: bool = False,
    cluster: str | None = None,
    settings: str | None = None,
) -> int:
    """Print a table of all simulators, or a paragraph for each that is named.

    Args:
        names: as `--sim` takes them; none for all.
        verbose: tell of each what it can do and where it deviates from the scene.
        cluster: address of the scheduler whose nodes count, instead of this machine.
        settings: print the settings of this simulator instead.

    Raises:
        BadInput: an interpreter that cannot be used, or names beside `settings`.
        SimulatorError: an unknown or broken simulator; no such cluster.
    """
    if settings is not None and names:
        raise BadInput("give names, or --settings SIM alone")
    if settings is not None:
        print(for_terminal("\n".join(_settings(settings))))
        return 0
    chosen, builds = read_names(names, Path.cwd())
    for name in chosen:
        adapter(name)  # complains of a broken one
    found = _missing(cluster, builds)
    if not chosen and not verbose:
        lines = _table(found)
    else:
        lines = _paragraphs(chosen, found, builds, verbose)
    for line in [*lines, *(f"BROKEN: {sentence}" for sentence in registry().unreadable)]:
        print(for_terminal(line))
    return 0


def _missing(cluster: str | None, builds: dict[str, str]) -> Missing:
    if cluster is None:
        return lambda name: None if name in builds else environments.missing(adapter(name).info)
    from pytest_simbench.cluster.offers import unmet
    from pytest_simbench.cluster.pool import Pool

    with closing(Pool(cluster)) as pool:
        nodes = pool.nodes()
    return lambda name: unmet(nodes, name, ["headless"])


def _table(missing: Missing) -> Iterator[str]:
    """A line for each simulator; one that is not ready says how to learn more."""
    rows: list[tuple[str, ...]] = [("simulator", "version", "ready", "tuned", "real", "step")]
    for name in known():
        if broken := problem(name):
            rows.append((name, "-", f"BROKEN: {broken}"))
        elif missing(name):
            rows.append((name, "-", f"no: not here; simbench list {name} says how to get it"))
        else:
            profiles = adapter(name).profiles
            has = ("yes" if profile in profiles else "-" for profile in ("tuned", "real"))
            settings = profiles.get("tuned") or next(iter(profiles.values()))
            step = f"{1000 * settings.timestep:.3g} ms"
            rows.append((name, _version(name) or "-", "yes", *has, step))
    yield from aligned(rows)


def _settings(name: str) -> Iterator[str]:
    """A line for each setting, with what it is below it where the terminal is too narrow; profiles
    of another kind (of a user's file) have a table each."""
    width = shutil.get_terminal_size((1000, 24)).columns
    of_kind: dict[type[Settings], dict[str, Settings]] = {}
    for profile, one in adapter(name).profiles.items():
        of_kind.setdefault(type(one), {})[profile] = one
    for kind, profiles in of_kind.items():
        ranges: dict[str, list[str]] = {}
        for part in searched(kind):
            ranges.setdefault(part.setting, []).append(str(part))
        rows = [(name, *profiles, "searched", "meaning")]
        for setting, meaning in meanings(kind).items():
            values = (in_words(getattr(one, setting)) for one in profiles.values())
            rows.append((setting, *values, ", ".join(ranges.get(setting, "-")), meaning))
        if max(map(len, aligned(rows))) <= width:
            yield from aligned(rows)
            continue
        heading, *lines = aligned([row[:-2] for row in rows])
        yield heading
        for line, (*_, search, meaning) in zip(lines, rows[1:], strict=True):
            told = meaning if search == "-" else f"{meaning} Searched: {search}."
            yield from (line, fill(f"    {told}", width, "    "))


def _paragraphs(
    names: Sequence[str], missing: Missing, builds: dict[str, str], verbose: bool
) -> Iterator[str]:
    """Of each simulator what it is, where it is and what it can; of all the table of capabilities
    too, and the reasons of those whose adapter is broken."""
    if not names:
        width = shutil.get_terminal_size((100, 24)).columns
        yield render(columns(), width)
        yield ""
    for name in names or known():
        if broken := problem(name):
            yield from (f"{name}: BROKEN: {broken}", "")
            continue
        info = adapter(name).info
        reason = missing(name)
        size = "" if info.install_size_mb is None else f"{info.install_size_mb} MB on disk; "
        start = "compiles at first use" if info.costly_start else "nothing to compile"
        yield f"{name}: {info.title} ({info.licence}), engine {info.engine}"
        yield f"    {f'NOT HERE: {reason}' if reason else _place(name, builds)}"
        yield f"    tested with version {info.tested_range}; {size}{start}"
        yield f"    modes: {', '.join(info.modes)}; profiles: {', '.join(adapter(name).profiles)}"
        yield f"    can: {', '.join(sorted(info.capabilities))}"
        for deviation in info.deviations if verbose else ():
            what = f"{deviation.quantity}: " if deviation.quantity else ""
            yield f"    deviates: {what}{deviation.reason}"
        yield ""


def _place(name: str, builds: dict[str, str]) -> str:
    """Where a simulator is and which version."""
    if name in builds:
        return f"in {builds[name]}"
    info = adapter(name).info
    other = environments.outside(info) if environments.interpreter(info) else None
    place = other.place if other else "installed"
    found = _version(name)
    untested = ", UNTESTED" if found and not info.tested(found) else ""
    return f"version {found or 'not known'}{untested}, {place}"


def _version(name: str) -> str | None:
    """The engine's version, as its Python package tells it; else itself, in a worker."""
    info = adapter(name).info
    other = environments.outside(info) if environments.interpreter(info) else None
    with suppress(Exception):  # not there, or metadata that nobody can read
        if found := other.version() if other else version(info.distribution):
            return found
    with TemporaryDirectory() as folder, suppress(WorkerError):  # a run will say why
        profile, here = next(iter(adapter(name).profiles)), Path(folder)
        case = Case.of(name, profile=profile, test="list", mode="headless", folder=here)
        with closing(WorkerProcess(case.launch(name), Where(name, case.mode))) as process:
            return process.construct(profile).versions.get(info.distribution)
    return None
