"""`simbench download`: measured data sets."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pytest_simbench.data.download import download as bring
from pytest_simbench.data.sets import data_set, default_folder
from pytest_simbench.ground.text import for_terminal


def download(names: Sequence[str], data: str | None) -> int:
    """Bring data sets from their public sources into a folder, or into the usual one.

    Raises:
        DataError: there is no such set, or it cannot be had.
    """
    folder = Path(data) if data else default_folder()
    for wanted in [data_set(name) for name in names]:
        bring(wanted, folder, lambda text: print(for_terminal(text)))
    return 0
