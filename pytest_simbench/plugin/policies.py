"""Which policies a test is made for: those of `--policies`, else the shipped ones."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.plugin import options

FIXTURE, MARK = "policy", "policies"

SHIPPED = ("pushing.py", "picking.py")
"""Files of the package of shipped policies."""


def read(config: pytest.Config) -> list[Any]:
    """All of a run, in order.

    Raises:
        pytest.UsageError: a file that has none, or two for one task with one name; one sentence.
    """
    from pytest_simbench.experiment.policy_file import read_policies
    from pytest_simbench.ground.errors import PolicyError
    from pytest_simbench.scene.policy import name_of

    found = []
    with options.refusing(PolicyError, "--policies"):
        for path, name in options.value(config, "sim_policies") or _shipped():
            found += read_policies(Path(path), name)
    seen = set()
    for policy in found:
        key = name_of(policy), getattr(policy, "task", "")
        if key in seen:
            raise pytest.UsageError(
                f"--policies: two policies are named {key[0]!r}; give one of them another `name`"
            )
        seen.add(key)
    return found


def _shipped() -> list[tuple[str, str]]:
    spec = find_spec("pytest_simbench.suites.policies")
    folder = Path(spec.origin).parent if spec is not None and spec.origin else Path()
    return [(str(folder / name), "") for name in SHIPPED]


def parametrize(metafunc: pytest.Metafunc, found: list[Any]) -> None:
    """Make a test of each policy that is for the task of its mark, or for none in particular.

    The shipped ones take hours on all simulators: they wait until somebody names the test's file.
    """
    from pytest_simbench.scene.policy import name_of

    mark = metafunc.definition.get_closest_marker(MARK)
    task, *names = (mark.args if mark is not None else ()) or ("",)
    chosen = [p for p in found if getattr(p, "task", "") in ("", task)]
    why, config = f"no policy of --policies is for the task {task!r}", metafunc.config
    stem = metafunc.definition.path.stem
    if not options.mentioned(config, ["sim_policies"]):
        chosen = [p for p in chosen if not names or name_of(p) in names]
        if not any(stem in arg for arg in config.args):
            chosen, why = [], f"it runs where --policies or {stem} is named"
    nothing = pytest.param(None, id="none", marks=pytest.mark.skip(reason=why))
    metafunc.parametrize(FIXTURE, [pytest.param(p, id=name_of(p)) for p in chosen] or [nothing])
