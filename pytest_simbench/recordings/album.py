"""Pictures of one repetition by the engine's own renderer: at the end of each phase, and of moments
within a phase that are known only later."""

from __future__ import annotations

import io
from collections import deque
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.ground.files import read_arrays
from pytest_simbench.records.paths import write_whole

FOLDER = "pictures"
"""In the run folder."""

SIZE = (480, 360)
"""Width and height of a picture [pixels]."""

LARGEST = 256 * 2**20
"""Of an album when it is read [bytes]."""

MOST = 40
"""Pictures; a task of ours has seven phases."""

GLANCES = 200
"""The last ones stay until it is known which show a moment: 8 s, and 100 MB."""

NEAR = 0.06
"""A glance that is farther from a moment does not show it [s]."""

Picture = NDArray[np.uint8]
"""(height, width, 3), red, green, blue."""


class Album:
    """Pictures by what they show, `after PHASE` or a moment; of several of one name the first.

    Attributes:
        pictures: in the order of time.
        times: simulated time of each [s].
    """

    def __init__(self) -> None:
        self.pictures: dict[str, Picture] = {}
        self.times: dict[str, float] = {}
        self._glances: deque[tuple[float, Picture]] = deque(maxlen=GLANCES)

    def look(self, phase: str, time: float, render: Callable[[int, int], Picture]) -> None:
        """Take a picture after a phase, unless there is one of this phase already."""
        if f"after {phase}" not in self.pictures and len(self.pictures) < MOST:
            self.add(f"after {phase}", time, render(*SIZE))

    def glance(self, time: float, picture: Picture) -> None:
        """A picture that may turn out to show a moment."""
        self._glances.append((time, picture))

    def find(self, moment: str, time: float) -> None:
        """Keep the glance that is nearest to a moment, if any is near."""
        found = min(self._glances, key=lambda glance: abs(glance[0] - time), default=None)
        if found is not None and abs(found[0] - time) <= NEAR and moment not in self.pictures:
            self.add(moment, *found)

    def add(self, name: str, time: float, picture: Picture) -> None:
        """Keep a picture, at its place in time."""
        self.pictures[name], self.times[name] = picture, time
        order = sorted(self.pictures, key=self.times.__getitem__)
        self.pictures = {name: self.pictures[name] for name in order}

    def write(self, folder: Path, name: str) -> None:
        """Write a file of a run folder, whole or not at all.

        Raises:
            OSError: it cannot be written.
        """
        file = io.BytesIO()
        names = np.array(list(self.pictures), dtype=np.str_)
        taken = {f"picture_{k}": picture for k, picture in enumerate(self.pictures.values())}
        times = np.array([self.times[name] for name in self.pictures], dtype=float)
        np.savez_compressed(file, phases=names, times=times, **taken)  # type: ignore[arg-type]
        write_whole(folder, name, file.getvalue())

    @classmethod
    def read(cls, path: Path) -> Album:
        """The album of a file that anybody may have made.

        Raises:
            FileError: it holds no arrays, or is too large.
            ValueError: it is none; the message is a whole sentence.
        """
        arrays, found = read_arrays(path, LARGEST), cls()
        names = list(map(str, np.ravel(arrays.get("phases", ()))[:MOST]))
        times = arrays.get("times", np.zeros(0))
        if times.dtype != float or times.shape != (len(names),) or not np.isfinite(times).all():
            raise ValueError(f"{path} is no album of a repetition: it does not tell its times")
        for k, name in enumerate(names):
            picture = arrays.get(f"picture_{k}")
            if picture is None or picture.dtype != np.uint8 or picture.shape[2:] != (3,):
                raise ValueError(f"{path} is no album of a repetition: picture {k} is none")
            found.add(name, float(times[k]), picture)
        return found
