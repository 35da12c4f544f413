"""What a world needs to be drawn, and a server without a window does not have."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from copy import deepcopy

from pytest_simbench.scene import Scene

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
