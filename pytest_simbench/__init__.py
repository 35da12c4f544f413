"""Compare robot simulators with a pytest test suite, or from Python: `run`, `load`."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from pytest_simbench.api.result import Run as Run
    from pytest_simbench.api.result import load as load
    from pytest_simbench.api.running import run as run
    from pytest_simbench.cli.values import BadInput as BadInput
    from pytest_simbench.gym.making import make as make
    from pytest_simbench.gym.making import make_vec as make_vec
    from pytest_simbench.scene.policy import Command as Command
    from pytest_simbench.scene.policy import Observation as Observation
    from pytest_simbench.scene.policy import Policy as Policy

LAZY = {
    "run": "api.running",
    "load": "api.result",
    "Run": "api.result",
    "BadInput": "cli.values",
    "make": "gym.making",
    "make_vec": "gym.making",
    **dict.fromkeys(("Command", "Observation", "Policy"), "scene.policy"),
}
"""Names and where they live; imported when they are asked for, as every pytest run imports this."""


def __getattr__(name: str) -> Any:
    if name in LAZY:
        return getattr(import_module(f"{__name__}.{LAZY[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*globals(), *LAZY]
