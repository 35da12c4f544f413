"""Policies of a user's file: Python that defines `policy`, or several in a dict `policies`."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from contextlib import suppress
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

from pytest_simbench.ground.errors import PolicyError
from pytest_simbench.ground.names import digest
from pytest_simbench.scene import SceneError
from pytest_simbench.scene.policy import Policy, as_policy
from pytest_simbench.worker.wire import named

ONE, SEVERAL = "policy", "policies"
"""What a file calls them."""


def read_policies(path: Path, name: str) -> list[Any]:
    """Those of a file: `policy`, else all of `policies`; or the one of a name, if it is not empty.

    A policy without a name of its own has that in `policies`, or the file's.

    Raises:
        PolicyError: the file cannot be imported, or has no such policy; one sentence.
    """
    module = _imported(path)
    several = getattr(module, SEVERAL, {})
    if not isinstance(several, Mapping):
        raise PolicyError(f"{path}: {SEVERAL} is {type(several).__name__}, no dict of policies")
    one = getattr(module, ONE, None)
    found = dict(several) if one is None else {path.stem: one}
    if name:
        known = {**several, **({} if name not in vars(module) else {name: vars(module)[name]})}
        if name not in known:
            choose = ", ".join(map(str, [*several, *([] if one is None else [ONE])])) or "nothing"
            raise PolicyError(f"{path} has no policy {name!r}; choose from {choose}")
        found = {path.stem if name == ONE else name: known[name]}
    if not found:
        raise PolicyError(f"{path} defines neither a {ONE!r} nor a dict of {SEVERAL!r}")
    return [_policy(path, str(name), policy) for name, policy in found.items()]


def _policy(path: Path, name: str, given: Any) -> Any:
    try:
        policy = as_policy(given)
    except SceneError as error:
        raise PolicyError(f"{path}: {error}") from None
    if getattr(policy, "name", Policy.name) in (Policy.name, "<lambda>"):
        with suppress(AttributeError):  # an object that takes no attributes keeps what it has
            policy.name = name
    return policy


def _imported(path: Path) -> Any:
    """The file as a module; what lies beside it can be imported meanwhile, as of a script."""
    where = path.resolve()
    name = f"simbench_policy_{digest(where)}"
    spec = spec_from_file_location(name, where)
    if spec is None or spec.loader is None:
        raise PolicyError(f"{path} is no file of Python")
    module = sys.modules[name] = module_from_spec(spec)
    sys.path.insert(0, str(where.parent))
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        why = " ".join(named(error).split())[:300]
        raise PolicyError(f"{path} cannot be imported: {why}") from None
    finally:
        with suppress(ValueError):
            sys.path.remove(str(where.parent))
    return module
