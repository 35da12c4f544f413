"""Do a robot's files, its drives and its scene fit each other?"""

from __future__ import annotations

from pytest_simbench.scene import Robot, Scene, SceneError
from pytest_simbench.simulator.errors import DescriptionError
from pytest_simbench.simulator.loops import reduced
from pytest_simbench.simulator.urdf import ROOT, PreparedRobot
from pytest_simbench.simulator.xml_file import read_xml


def check_robot(robot: Robot) -> None:
    """Check all files of a robot, and that they fit its drives.

    Raises:
        DescriptionError: what is wrong, where, and what to do.
    """
    reduced(PreparedRobot(robot))
    if not robot.srdf:
        return
    srdf = read_xml(robot.srdf, "the list of link pairs")
    if srdf.tag != "robot":
        raise DescriptionError(f"{robot.srdf} is no SRDF: it holds <{srdf.tag}>, not <robot>")


def check_names(scene: Scene) -> None:
    """Raise `SceneError` for a body that has the name of one of the robot's links.

    Engines keep both under their names, in one list.
    """
    if scene.robot is None:
        return
    xml = read_xml(scene.robot.urdf, "the robot description")
    links = {ROOT, *(link.get("name") for link in xml.findall("link"))}
    for body in scene.bodies:
        if body.name in links:
            raise SceneError(
                f"scene {scene.name!r}: a body is named {body.name!r}, as a link of the robot "
                f"{scene.robot.name!r} is; give it another name"
            )
