"""The data sets that are known: where each comes from, what it must hash to, and who reads it."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pytest_simbench.data import impacts, pushes, tosses
from pytest_simbench.data.measured import DataError, DataMissing

VARIABLE = "SIMBENCH_DATA"


@dataclass(frozen=True)
class DataSet:
    """A measured data set in a public repository.

    Attributes:
        name: by which tests ask for it.
        title: what it is, in a few words.
        repository: `OWNER/NAME` on GitHub.
        commit: at which it is taken.
        files: how the paths of its files in the repository begin.
        sha256: of these files, see `download.digest`.
        licence: of the data.
        read: reads it from a folder; None where the folder does not hold it.
        convert: writes the arrays of the source's files, by path, into a folder.
    """

    name: str
    title: str
    repository: str
    commit: str
    files: tuple[str, ...]
    sha256: str
    licence: str
    read: Callable[[Path], Any]
    convert: Callable[[Mapping[str, bytes], Path], None]

    @property
    def url(self) -> str:
        """Of the repository at that commit, as a gzipped tar archive."""
        return f"https://codeload.github.com/{self.repository}/tar.gz/{self.commit}"


SETS = {
    item.name: item
    for item in (
        DataSet(
            name=tosses.NAME,
            title="570 tosses of a cube",
            repository="DAIRLab/contact-nets",
            commit="c3dc21c94577ff4ed99123f0b00bfe57bb2d1d90",
            files=("data/tosses_processed/",),
            sha256="b51721a36ded401b40061d14082dcabd5bee6c403b65c2f777cb223148b63725",
            licence="BSD-3-Clause",
            read=tosses.read,
            convert=tosses.convert,
        ),
        DataSet(
            name=pushes.NAME,
            title="46 runs of a Kinova Mico2, half of which push a cube",
            repository="erwincoumans/quantifying-the-reality-gap-in-robotic-manipulation-tasks",
            commit="2b21d34a506199eefb72c640ff1571dbb433ffea",
            files=(
                "Data/MotionCapture/Experiment1/",
                "Data/MotionCapture/Experiment3/",
                "Software/kinova_description/urdf/m1n6s300.urdf",
                *(f"Software/kinova_description/meshes/{name}.STL" for name in pushes.MESHES),
            ),
            sha256="32fa5885be7ea985f6da7a734d71dc8385c73c316f0d6b1374bbd6cc539f853f",
            licence="BSD-3-Clause",
            read=pushes.read,
            convert=pushes.convert,
        ),
        DataSet(
            name=impacts.NAME,
            title="500 tosses of a square in a plane",
            repository="DAIRLab/ImpactModeling",
            commit="f6c28898845da6d48efdd6c1c696db2fb3716edf",
            files=("Wang/Wang-Mason Square/dice-data-processed/traj_",),
            sha256="462743c984cb61dd3b6ec5e381377b80d631d1ae697b603fd817b4ccd4f6034b",
            licence="BSD-3-Clause",
            read=impacts.read,
            convert=impacts.convert,
        ),
    )
}


def data_set(name: str) -> DataSet:
    """The data set of that name.

    Raises:
        DataError: there is none; lists those there are.
    """
    if name not in SETS:
        raise DataError(f"there is no data set {name!r:.100}; choose from {', '.join(SETS)}")
    return SETS[name]


def default_folder() -> Path:
    """Where data sets are: $SIMBENCH_DATA, else a folder of the user's cache."""
    if given := os.environ.get(VARIABLE):
        return Path(given)
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "pytest-simbench" / "data"


def read(name: str, folder: str | Path | None = None) -> Any:
    """A data set, from a folder or where data sets are.

    Raises:
        DataMissing: it is not there.
        DataError: there is no such set, or what is there is broken.
    """
    found, place = data_set(name), Path(folder or default_folder())
    held = found.read(place) if place.is_dir() else None
    if held is None:
        raise DataMissing(
            f"the data set {name} ({found.title}) is not in {place}: "
            f"simbench download {name}, or --sim-data DIR (simbench: ${VARIABLE})"
        )
    return held
