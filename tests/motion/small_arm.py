"""A small robot of boxes in a TOML file next to a URDF, as a user would write one."""

from __future__ import annotations

from pathlib import Path

LINK = """
  <link name="{name}">
    <inertial><origin xyz="0 0 {middle}"/><mass value="{mass}"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
    <collision><origin xyz="{shift}"/><geometry><box size="{size}"/></geometry></collision>
  </link>"""
JOINT = """
  <joint name="{name}" type="{kind}">
    <parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}"/><axis xyz="{axis}"/>
    <limit lower="{lower}" upper="{upper}" effort="80" velocity="2"/>
  </joint>"""


def link(name: str, size: str, shift: str = "0 0 0.1", middle: float = 0.1, mass: float = 1) -> str:
    return LINK.format(name=name, size=size, shift=shift, middle=middle, mass=mass)


def joint(name: str, parent: str, child: str, xyz: str, axis: str, kind: str = "revolute") -> str:
    lower, upper = (-2.5, 2.5) if kind == "revolute" else (0.0, 0.05)
    return JOINT.format(**locals())


URDF = f"""<robot name="small">
{link("foot", "0.1 0.1 0.04", "0 0 0.02")}
{link("column", "0.06 0.06 0.15")}{joint("turn", "foot", "column", "0 0 0.05", "0 0 1")}
{link("upper", "0.05 0.05 0.2", "0 0 0.15")}{joint("lift", "column", "upper", "0 0 0.2", "0 1 0")}
{link("lower", "0.05 0.05 0.2", "0 0 0.15")}{joint("bend", "upper", "lower", "0 0 0.3", "0 1 0")}
{link("left", "0.02 0.01 0.08", "0 0.005 0.06", 0.05, 0.1)}
{joint("left_finger", "lower", "left", "0 0 0.3", "0 1 0", "prismatic")}
{link("right", "0.02 0.01 0.08", "0 -0.005 0.06", 0.05, 0.1)}
{joint("right_finger", "lower", "right", "0 0 0.3", "0 -1 0", "prismatic")}
  <link name="grip"/>
  <joint name="to_grip" type="fixed">
    <parent link="lower"/><child link="grip"/><origin xyz="0 0 0.38"/>
  </joint>
</robot>
"""

TOML = """\
name = "small"
urdf = "small.urdf"
base = [0.1, 0.0, 0.2]

[arm]
joints = ["turn", "lift", "bend"]
ready = [0.0, 0.4, 1.2]
stiffness = 2000.0
damping = [200.0, 200.0, 150.0]
acceleration = 8.0

[hand]
joints = ["left_finger", "right_finger"]
opened = 0.04
closed = 0.0
stiffness = 1000.0
damping = 40.0
effort = 20.0
tool_frame = "grip"
"""


def still(left: float, right: float) -> str:
    """A hand that only touches, its fingers locked."""
    arm = TOML[: TOML.index("[hand]")] + '[hand]\ntool_frame = "grip"\n'
    return f"{arm}\n[locked]\nleft_finger = {left}\nright_finger = {right}\n"


def small_arm(folder: Path, toml: str = TOML, urdf: str = URDF) -> Path:
    """Write both files; the path of the TOML file."""
    (folder / "small.urdf").write_text(urdf, encoding="utf-8")
    path = folder / "small.toml"
    path.write_text(toml, encoding="utf-8")
    return path
