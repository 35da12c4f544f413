"""Gazebo's window: a program of its own, `gz sim -g`, that hears the server by messages.

The server is in this process, and its partition in the environment, which the program inherits. So
it finds this server and no other. The world tells it what to draw if it has the system
SceneBroadcaster (`sdf.world_text`) and what a server without a window does not have.
"""

from __future__ import annotations

import os
import shutil
import signal
import tempfile
import time
import xml.etree.ElementTree as ET
from copy import deepcopy
from pathlib import Path

from pytest_simbench.scene import Scene
from pytest_simbench.simulator import SimulatorError, UnavailableError
from pytest_simbench.simulator.external import Program

PROGRAM = "gz"
"""Gazebo's command line; it takes its parts from where it is installed."""

TITLE = "Gazebo's window (gz sim -g)"

START = 3.0
"""Wall time in which a window that cannot be opened is seen to end [s]: it tells nobody that it is
open."""

END = 5.0
"""Wall time to close it [s]."""


class Window:
    """The window on the server of this process.

    Args:
        version: of the server: several releases of Gazebo may be installed, whose messages differ.
        start: wall time in which it may fail [s].

    Raises:
        UnavailableError: the program is not there, or ends at once, as where its libraries or a
            display are missing; the message has its last words.
    """

    def __init__(self, version: str, install: str, start: float = START) -> None:
        command = shutil.which(PROGRAM)
        if command is None:
            raise UnavailableError(
                f"{TITLE} needs the program {PROGRAM}, which is not on the PATH; {install}"
            )
        self._folder = tempfile.TemporaryDirectory(
            prefix="simbench-gazebo-window-", ignore_cleanup_errors=True
        )
        chosen = ["--force-version", version] if version else []
        self.program = Program(TITLE, [command, "sim", "-g", *chosen], Path(self._folder.name))
        opened = time.monotonic() + start
        try:
            self.program.wait_until(lambda: time.monotonic() > opened, 2 * start + END)
        except SimulatorError as error:
            self.close()
            raise UnavailableError(f"{error}; {install}") from error

    def close(self) -> None:
        """Close it; it may be closed already, by the user."""
        self.program.end(lambda: os.kill(self.program.pid, signal.SIGTERM), END)
        self._folder.cleanup()


GREY = (0.6, 0.6, 0.6, 1.0)
"""Of ground and links; bodies have the scene's colours."""


def add_drawing(world: ET.Element, scene: Scene) -> None:
    """Have a world of SDF drawn: every collision's shape once more as a visual, a light, and the
    system that tells a window of them."""
    ET.SubElement(
        world,
        "plugin",
        filename="gz-sim-scene-broadcaster-system",
        name="gz::sim::systems::SceneBroadcaster",
    )
    light = ET.SubElement(world, "light", name="sun", type="directional")
    ET.SubElement(light, "direction").text = "-0.5 0.3 -1"
    colours = {body.name: body.colour for body in scene.bodies}
    for model in world.findall("model"):
        for link in model.findall("link"):
            for collision in link.findall("collision"):
                _add_visual(link, collision, colours.get(model.get("name", ""), GREY))


def _add_visual(link: ET.Element, collision: ET.Element, colour: tuple[float, ...]) -> None:
    visual = ET.SubElement(link, "visual", name=collision.get("name", ""))
    visual.extend(deepcopy(collision.findall("pose") + collision.findall("geometry")))
    plane = visual.find("geometry/plane")
    if plane is not None:  # as a shape it has no end
        ET.SubElement(plane, "size").text = "20 20"
    material = ET.SubElement(visual, "material")
    for light in ("ambient", "diffuse"):
        ET.SubElement(material, light).text = " ".join(map(repr, map(float, colour)))
