"""What measured sets have in common: motions, halves of them, and what can be wrong with a set."""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar

import numpy as np

from pytest_simbench.ground.files import FileError, read_arrays

LARGEST = 256 * 2**20
"""Of a file of motions [bytes]; the shared ones have 7 MB."""

Half = Literal["held_out", "chosen_on", "all"]
"""Of the motions: those that are held out, those by which something was chosen, all. Settings are
chosen on one half and published on the other."""

T = TypeVar("T")


class DataError(ValueError):
    """A file that is no data set, or a download that did not bring one; one sentence."""


class DataMissing(DataError):
    """A data set that is not on this machine; the sentence ends with the command that brings it."""


class MeasuredMotion(ABC):
    """One measured motion."""

    @property
    @abstractmethod
    def number(self) -> int:
        """In the source."""

    @property
    def held_out(self) -> bool:
        """Whether it is kept from choosing: here each second one."""
        return self.number % 2 == 1

    @abstractmethod
    def content(self) -> Iterable[bytes | np.ndarray]:
        """What makes it what it is, as bytes and numbers."""


M = TypeVar("M", bound=MeasuredMotion)


@dataclass(frozen=True, eq=False)
class Measured(Generic[M]):
    """Motions in the order of the source. Two sets are equal when their digests are.

    Attributes:
        items: the motions.
    """

    items: tuple[M, ...] = field(repr=False)

    def half(self, which: Half) -> tuple[M, ...]:
        """The motions by which something was chosen, or those that were held out, or all."""
        wanted = {"all": (False, True), "chosen_on": (False,), "held_out": (True,)}[which]
        return tuple(item for item in self.items if item.held_out in wanted)

    @cached_property
    def digest(self) -> str:
        """Of all motions: short, for records."""
        found = hashlib.sha256()
        for item in self.items:
            for part in item.content():
                if isinstance(part, np.ndarray):
                    part = np.ascontiguousarray(part, "<f8").tobytes()
                found.update(part)
        return found.hexdigest()[:12]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, type(self)) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)


def read_motions(path: Path, what: str, make: Callable[[Mapping[str, Any]], T]) -> T:
    """What is made of a file's arrays.

    Args:
        path: of the file.
        what: its motions are called, for messages.
        make: raises `KeyError` where an array is missing, `ValueError` for others that hold none.

    Raises:
        DataError: a file that is broken, cut off, or something else.
    """
    try:
        return make(read_arrays(path, LARGEST))
    except FileError as error:
        raise DataError(str(error)) from None
    except KeyError as error:
        raise DataError(f"{path} holds no {what}: the array {error} is missing") from None
    except ValueError as error:
        raise DataError(f"{path} holds no {what}: {error}") from None
