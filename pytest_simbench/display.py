"""A display for GUI mode: the user's own, else a virtual one."""

from __future__ import annotations

import os
import shutil
from typing import Any

import pytest

SIZE = (1280, 960)


class Displays:
    """Hands out the display of a session, starting a virtual one when there is none."""

    def __init__(self) -> None:
        self._virtual: Any = None

    def environment(self) -> dict[str, str]:
        """Variables that a worker with a window needs. Skips the test when there is no display."""
        if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
            return {}
        if self._virtual is None:
            if shutil.which("Xvfb") is None:
                pytest.skip("no display, and no Xvfb for a virtual one: apt-get install xvfb")
            from pyvirtualdisplay.display import Display

            self._virtual = Display(visible=False, size=SIZE, manage_global_env=False).start()
        return {"DISPLAY": f":{self._virtual.display}"}

    def close(self) -> None:
        """Stop the virtual display, if one was started."""
        if self._virtual is not None:
            self._virtual.stop()
            self._virtual = None
