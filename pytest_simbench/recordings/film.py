"""What the engine's own renderer shows of one repetition: a film of it, as mp4 (H.264) with PyAV,
and pictures at the end of each phase, and of moments within a phase that are known only later.

A second of the film is a second of simulated time.
"""

from __future__ import annotations

import io
import threading
from collections import deque
from collections.abc import Callable
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.ground.files import read_arrays
from pytest_simbench.records.paths import whole, write_whole

INSTALL = "videos need PyAV: pip install 'pytest-simbench[video]'"

FOLDER = "videos"
"""In the run folder."""

PERIOD = 0.04
"""Simulated time between two pictures [s]: 25 a second, as in television (Europe)."""

CODEC, LOOK = "libx264", {"crf": "23", "preset": "veryfast"}
"""What every browser plays. The constant rate factor is x264's default; `veryfast` takes a tenth of
the time that drawing takes."""

TICKS = 1000
"""Of the film's clock, a second."""


class FilmsUnavailable(ImportError):
    """PyAV is not installed; the message says how to install it."""


def check_available() -> None:
    """Complain before anything runs.

    Raises:
        FilmsUnavailable: PyAV is not installed.
    """
    if find_spec("av") is None:
        raise FilmsUnavailable(INSTALL)


class Film:
    """One film, picture by picture; a minute takes some megabytes of memory. Its file in the run
    folder is there when it is whole.

    Attributes:
        problem: why there are no more, as a sentence.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self.path = folder / name
        self._place = folder, name
        self.frames = 0
        self.problem = ""
        self._content = io.BytesIO()
        self._lock = threading.Lock()  # pictures come in a thread of the worker's connection
        self._over = False
        self._file: Any = None
        self._stream: Any = None
        self._first = self._last = 0

    def take(self, time: float, picture: NDArray[np.uint8]) -> None:
        """Add a picture (height, width, 3) of a simulated time [s]; one that does not come after
        those before is left out. Raises nothing: what goes wrong is in `problem`."""
        with self._lock:
            if self.problem or self._over:
                return
            try:
                self._add(round(time * TICKS), picture)
            except (OSError, ValueError) as error:  # PyAV's own errors are of these kinds
                self._failed(error)

    def finish(self, keep: bool = True) -> None:
        """The end of the film; nothing of it stays unless it is to be kept and has a picture."""
        with self._lock:
            self._over = True
            try:
                if self._file is not None:
                    if not self.problem:
                        self._file.mux(self._stream.encode(None))
                    self._file.close()
                    if keep and not self.problem:
                        write_whole(*self._place, self._content.getvalue())
            except (OSError, ValueError) as error:
                self._failed(error)
            self._file = None
            self._content.close()

    def _failed(self, error: Exception) -> None:
        self.problem = f"{self.path} could not be written ({error})"

    def _add(self, tick: int, picture: NDArray[np.uint8]) -> None:
        import av

        if self._file is None:
            self._file = av.open(self._content, "w", format="mp4")
            self._stream = stream = self._file.add_stream(CODEC, round(1 / PERIOD), options=LOOK)
            stream.height, stream.width = (edge - edge % 2 for edge in picture.shape[:2])
            stream.pix_fmt = "yuv420p"
            stream.codec_context.time_base = Fraction(1, TICKS)
            self._first, self._last = tick, tick - 1
        if tick <= self._last:
            return
        even = np.ascontiguousarray(picture[: self._stream.height, : self._stream.width])
        frame = av.VideoFrame.from_ndarray(even, format="rgb24")
        frame.pts, frame.time_base = tick - self._first, Fraction(1, TICKS)
        self._file.mux(self._stream.encode(frame))
        self._last = tick
        self.frames += 1


PICTURES = "pictures"
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
        names = np.array(list(self.pictures), dtype=np.str_)
        taken = {f"picture_{k}": picture for k, picture in enumerate(self.pictures.values())}
        times = np.array([self.times[name] for name in self.pictures], dtype=float)
        with whole(folder, name) as file:
            np.savez_compressed(file, phases=names, times=times, **taken)  # type: ignore[arg-type]

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
