"""Compare robot simulators with a pytest test suite."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from pytest_simbench.gym.making import make as make
    from pytest_simbench.gym.making import make_vec as make_vec

LAZY = {
    "make": "gym.making",
    "make_vec": "gym.making",
}
"""Names and where they live; imported when they are asked for, as every pytest run imports this."""


def __getattr__(name: str) -> Any:
    if name in LAZY:
        return getattr(import_module(f"{__name__}.{LAZY[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
