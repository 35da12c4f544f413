"""A film of one repetition by the engine's own renderer, as mp4 (H.264) with PyAV.

A second of the film is a second of simulated time.
"""

from __future__ import annotations

import io
import threading
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.records.paths import write_whole

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
