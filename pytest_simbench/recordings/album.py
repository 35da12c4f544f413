"""Pictures of one repetition by the engine's own renderer: one at the end of each phase."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.records.paths import write_whole
from pytest_simbench.simulator.files import read_arrays

FOLDER = "pictures"
"""In the run folder."""

SIZE = (480, 360)
"""Width and height of a picture [pixels]."""

LARGEST = 256 * 2**20
"""Of an album when it is read [bytes]."""

MOST = 40
"""Pictures; a task of ours has seven phases."""

Picture = NDArray[np.uint8]
"""(height, width, 3), red, green, blue."""


class Album:
    """Pictures by the name of the phase that had just ended; of several of one name the first."""

    def __init__(self) -> None:
        self.pictures: dict[str, Picture] = {}

    def look(self, phase: str, render: Callable[[int, int], Picture]) -> None:
        """Take a picture, unless there is one of this phase already."""
        if phase not in self.pictures and len(self.pictures) < MOST:
            self.pictures[phase] = render(*SIZE)

    def write(self, path: Path) -> None:
        """Write the file, whole or not at all.

        Raises:
            OSError: it cannot be written.
        """
        file = io.BytesIO()
        names = np.array(list(self.pictures), dtype=np.str_)
        taken = {f"picture_{k}": picture for k, picture in enumerate(self.pictures.values())}
        np.savez_compressed(file, phases=names, **taken)  # type: ignore[arg-type]
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, file.getvalue())

    @classmethod
    def read(cls, path: Path) -> Album:
        """The album of a file that anybody may have made.

        Raises:
            FileError: it holds no arrays, or is too large.
            ValueError: it is none; the message is a whole sentence.
        """
        arrays, found = read_arrays(path, LARGEST), cls()
        for k, name in enumerate(map(str, arrays.get("phases", ())[:MOST])):
            picture = arrays.get(f"picture_{k}")
            if picture is None or picture.dtype != np.uint8 or picture.shape[2:] != (3,):
                raise ValueError(f"{path} is no album of a repetition: picture {k} is none")
            found.pictures[name] = picture
        return found
