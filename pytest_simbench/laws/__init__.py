"""Laws: cases whose right answer is known, by which a simulator can be wrong all by itself."""

from importlib import import_module

from pytest_simbench.laws.base import Law, Reading
from pytest_simbench.records.phenomena import PHENOMENA

_MODULES = (
    "free", "contact", "impact", "sticking", "sliding", "rolling", "hands", "joints", "drives",
    "loops", "domino", "loads", "insertion",
)  # fmt: skip
"""In the order in which tables name the laws of a phenomenon."""

for _module in _MODULES:
    import_module(f"{__name__}.{_module}")

LAWS: tuple[Law, ...] = tuple(
    sorted((law() for law in Law.known), key=lambda law: PHENOMENA.index(law.phenomenon))
)
"""All of them, by phenomenon."""

__all__ = ["LAWS", "Law", "Reading"]
