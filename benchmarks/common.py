"""What the benchmarks share: arguments, medians, cases, and runs of many records."""

from __future__ import annotations

import argparse
import random
import statistics
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))  # for what the tests share

from pytest_simbench.client.environments import missing  # noqa: E402
from pytest_simbench.experiment.case import Case  # noqa: E402
from pytest_simbench.records.folder import RunFolder  # noqa: E402
from pytest_simbench.simulator.registry import adapter, registered  # noqa: E402
from pytest_simbench.tasks import Stacking  # noqa: E402

REAL = ROOT / "tests" / "measure" / "stacking_records.jsonl"
"""Records of real repetitions."""


def arguments(doc: str | None, words: Mapping[str, Any], **options: Any) -> argparse.Namespace:
    """The command line.

    Args:
        doc: of the script.
        words: positional arguments and their defaults; a list takes all that are left.
        options: `--name` for each, and its default.
    """
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=doc, formatter_class=raw)
    for name, default in words.items():
        many = isinstance(default, list)
        kind = str if many else type(default)
        parser.add_argument(name, nargs="*" if many else "?", type=kind, default=default)
    for name, default in options.items():
        parser.add_argument(f"--{name}", type=type(default), default=default)
    return parser.parse_args()


def present() -> list[str]:
    """The simulators of this environment."""
    return [name for name in registered() if not missing(adapter(name).info)]


def case(simulator: str, folder: Path, **more: Any) -> Case:
    """A headless case with the tuned settings."""
    return Case.of(simulator, test="t[x]", mode="headless", profile="tuned", folder=folder, **more)


def spread(values: Sequence[float], form: str = ".3f") -> str:
    """The median of values, and how far they lie apart."""
    middle, low, high = statistics.median(values), min(values), max(values)
    return f"{middle:{form}} (min {low:{form}}, max {high:{form}}, {len(values)} times)"


def write_run(folder: Path, number: int, simulators: int = 8) -> None:
    """Write a run of so many records, in turn of so many simulators.

    Each is a real one under another name, repetition and seed, drawn with a fixed seed.
    """
    real = [r for r in RunFolder.of(REAL).read().records if r.ok]
    names = sorted({r.simulator for r in real})
    pools = {name: [r for r in real if r.simulator == name] for name in names}
    draw, run = random.Random(0), RunFolder(folder)
    run.lock()
    run.describe(Stacking())
    for k in range(number):
        name = names[k % simulators % len(names)]
        new, drawn = f"{name}_{k % simulators}", draw.choice(pools[name])
        run.append(
            replace(
                drawn,
                simulator=new,
                test=drawn.test.replace(f"[{name}-", f"[{new}-"),
                repetition=k // simulators + 1,
                seed=1000 + k // simulators,
                settings=pools[name][0].settings,
                versions=pools[name][0].versions,
            )
        )
    run.close()
