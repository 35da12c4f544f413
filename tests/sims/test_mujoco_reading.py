"""MJCF scenes: nothing is dropped in silence, and what is carried is the same world."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco")

from pytest_simbench.sims.mujoco.adapter import MuJoCo  # noqa: E402
from pytest_simbench.sims.mujoco.own_file import OwnFile  # noqa: E402
from pytest_simbench.sims.mujoco.reading import Reading  # noqa: E402

from pytest_simbench.parity.compare import compare  # noqa: E402
from pytest_simbench.parity.quantities import expected_quantities  # noqa: E402
from pytest_simbench.scene import Box, Compound, Pose, Scene, Sphere  # noqa: E402
from pytest_simbench.simulator import DescriptionError, NotSupportedError  # noqa: E402

from .worlds import loaded  # noqa: E402

SMALL = """
<mujoco model="small">
  <option timestep="0.001" integrator="implicitfast"/>
  <default><geom solref="0.02 1"/></default>
  <asset><mesh name="wedge" vertex="0 0 0  .1 0 0  0 .1 0  .1 .1 0  0 0 .06  0 .1 .06"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 .1" friction=".7"/>
    <body name="post" pos="1 0 .2"><geom type="cylinder" size=".05 .2"/></body>
    <body name="box" pos="0 0 .3" quat="2 .3 .4 .5">
      <freejoint name="f"/><geom name="g" type="box" size=".05 .04 .03" friction=".6"/>
    </body>
    <body name="ball" pos="0 .4 .3"><freejoint/><geom size=".05"/></body>
    <body name="rock" pos="0 .8 .3"><freejoint/><geom type="mesh" mesh="wedge"/></body>
    <body name="tool" pos="0 -.4 .5" euler="40 0 0">
      <freejoint/><geom type="box" size=".1 .02 .02"/>
      <geom type="capsule" size=".02 .05" pos=".1 0 .03" density="3000"/>
      <body pos="-.1 0 .04"><geom type="sphere" size=".03"/></body>
    </body>
  </worldbody>
</mujoco>
"""
"""A ground, a fixed body, and free ones: of one shape each, a mesh, and of three shapes."""


def read(path: Path, text: str = SMALL) -> Reading:
    path = path / "scene.xml"
    path.write_text(text)
    return Reading(str(path))


def test_each_body_is_the_simplest_that_it_can_be(tmp_path: Path) -> None:
    scene = read(tmp_path).scene
    kinds = {body.name: type(body) for body in scene.bodies}
    assert [kinds[name] for name in ("box", "ball", "rock", "tool")] == [
        Box, Sphere, Compound, Compound,
    ]  # fmt: skip
    assert scene.body("post").fixed
    assert scene.ground_friction == 0.7
    assert scene.body("box").friction == 0.6
    assert scene.body("box").moments is None


@pytest.mark.parametrize("profile", ["default", "file"])
def test_masses_and_the_accelerations_of_a_step_are_those_of_the_file(
    tmp_path: Path, profile: str
) -> None:
    """In the air under a wrench, where all was carried."""
    reading = read(tmp_path)
    scene = reading.scene
    simulator = loaded(MuJoCo, scene, profile, timestep=0.001)
    for body in scene.free_bodies:
        assert body.mass == pytest.approx(float(reading.model.body(body.name).subtreemass[0]))
    rows = np.zeros((len(scene.free_bodies), 6))
    rows[:, 3:] = 0.01, 0.02, 0.03
    simulator.push(rows)
    simulator.step()
    state = simulator.body_state()
    for body, row in zip(scene.free_bodies, state, strict=True):
        turn = body.pose.rotation()
        spin = turn @ (turn.T @ (0.01, 0.02, 0.03) / body.inertia()) * 0.001
        # Of the rock and the tool the file's frame is not at the centre of mass.
        apart = body.name in ("rock", "tool") and profile == "file"
        bound = 1e-6 if apart else 1e-9  # of second order in the step
        assert row[7:10] == pytest.approx([0, 0, -9.81e-3], rel=1e-6, abs=bound)
        if body.name != "tool" or profile == "default":  # a force acts on the root's own centre
            assert row[10:] == pytest.approx(spin, rel=1e-3)
    simulator.close()


def test_file_and_carried_scene_accelerate_alike_in_contact(tmp_path: Path) -> None:
    """A box, a ball and a compound on the plane, all of it carried: 1e-6 in accelerations."""
    text = SMALL.replace("0 0 .3", "0 0 .03").replace(' quat="2 .3 .4 .5"', "")
    text = text.replace("0 .4 .3", "0 .4 .05").replace("0 -.4 .5", "0 -.4 .0199")
    text = text.replace(' euler="40 0 0"', "").replace('pos="-.1 0 .04"', 'pos="-.1 0 .011"')
    # A body fixed on another has an inertia of its own in MuJoCo's softness of contacts.
    text = text.replace('<body pos="-.1 0 .011"><geom', '<geom pos="-.1 0 .011"')
    text = text.replace('size=".03"/></body>', 'size=".03"/>')
    text = text.replace('friction=".7"', "").replace("0 .8 .3", "0 .8 .0")
    reading = read(tmp_path, text)
    found, step = {}, 1e-5  # the speed of the centre of mass differs in second order
    for profile in ("default", "file"):
        simulator = loaded(MuJoCo, reading.scene, profile, timestep=step)
        before = simulator.body_state()[:, 7:]
        simulator.step()
        found[profile] = (simulator.body_state()[:, 7:] - before) / step
        assert simulator.contact_count() > 0
        simulator.close()
    assert found["file"] == pytest.approx(found["default"], rel=1e-6, abs=1e-5)


@pytest.mark.parametrize("profile", ["default", "tuned", "file"])
def test_the_scene_passes_parity(tmp_path: Path, profile: str) -> None:
    check_parity(read(tmp_path).scene, profile)


def test_a_scene_without_a_ground_below_zero_is_moved_up(tmp_path: Path) -> None:
    text = SMALL.replace('<geom name="floor" type="plane"', '<geom name="floor" type="box"')
    reading = read(tmp_path, text.replace("0 .4 .3", "0 .4 -.3").replace("1 1 .1", "1 1 .01"))
    assert reading.lift == pytest.approx(0.35)
    assert {"geom plane", "height"} <= {line.quantity for line in reading.account}
    check_parity(reading.scene, "file")


def test_a_raised_ground_moves_the_scene(tmp_path: Path) -> None:
    text = SMALL.replace('type="plane"', 'type="plane" pos="0 0 -.2"')
    reading = read(tmp_path, text)
    assert reading.lift == pytest.approx(0.2)
    assert reading.scene.body("ball").pose.position == pytest.approx((0, 0.4, 0.5))
    check_parity(reading.scene, "file")


def wrong(simulator: MuJoCo) -> dict[str, str]:
    """By quantity: in what the world is not its scene, and no deviation excuses it."""
    scene = simulator.scene
    declared = [d for d in simulator.info.deviations if d.concerns(scene)]
    expected = expected_quantities(scene, simulator.settings)
    return compare(expected, simulator.read_back(), declared, "mujoco").wrong


def check_parity(scene: Scene, profile: str) -> None:
    simulator = loaded(MuJoCo, scene, profile)
    assert not wrong(simulator)
    poses = [body.pose.as_array() for body in scene.free_bodies]
    state = simulator.body_state()
    assert state[:, :3] == pytest.approx(np.array(poses)[:, :3])
    simulator.close()


def test_the_file_starts_where_the_scene_has_its_bodies(tmp_path: Path) -> None:
    scene = read(tmp_path).scene.with_pose("tool", Pose.at(0.5, 0.5, 0.7, yaw=1.0))
    check_parity(scene, "file")


@pytest.mark.parametrize("scene", [Scene("none"), Scene("other", file="x.xml")])
def test_the_profile_file_needs_a_file(scene: Scene) -> None:
    with pytest.raises((NotSupportedError, DescriptionError), match="file|x.xml"):
        loaded(MuJoCo, scene, "file")


def test_more_shapes_than_can_be_held_against_each_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pytest_simbench.sims.mujoco.reading.MOST_SHAPES", 2)
    with pytest.raises(DescriptionError, match=r".xml: \d+ shapes collide, and 2 can; leave out"):
        read(tmp_path)


REFUSED = {
    "no shape that collides: box": ('name="g"', 'contype="0" conaffinity="0"'),
    "is not level": ('type="plane"', 'type="plane" euler="10 0 0"'),
    "type ellipsoid": ('type="box" size=".05 .04', 'type="ellipsoid" size=".05 .04'),
    "overlap": ("0 .4 .3", "0 .02 .3"),
    "(?i)mass and inertia.*line": ('name="g"', 'mass="0"'),
    "XML parse error": ("</mujoco>", ""),
}


@pytest.mark.parametrize(("why", "change"), REFUSED.items())
def test_what_no_scene_holds_is_refused_in_one_sentence(
    tmp_path: Path, why: str, change: tuple[str, str]
) -> None:
    text = SMALL.replace(*change)
    assert text != SMALL
    with pytest.raises(DescriptionError, match=why) as error:
        read(tmp_path, text)
    assert "scene.xml: " in str(error.value)
    assert "\n" not in str(error.value)


CONCAVE = SMALL.replace(
    "</asset>",
    '<mesh name="notch" vertex="0 0 0 .1 0 0 .1 .1 0 0 .1 0 .05 .05 .02 .05 .05 .1" face="'
    '0 4 1 1 4 2 2 4 3 3 4 0 0 1 5 1 2 5 2 3 5 3 0 5"/></asset>',
).replace('mesh="wedge"', 'mesh="notch"')

TOLD = {
    "geom mesh (concave)": CONCAVE,
    "actuator": SMALL.replace(
        "</worldbody>", '</worldbody><actuator><motor joint="f"/></actuator>'
    ),
    "equality (weld)": SMALL.replace(
        "</worldbody>",
        '</worldbody><equality><weld body1="box" body2="ball"/></equality>',
    ),
    "key": SMALL.replace("</worldbody>", '</worldbody><keyframe><key name="k"/></keyframe>'),
    "geom contype, conaffinity (of single shapes)": SMALL.replace(
        'density="3000"', 'contype="2" conaffinity="2"'
    ),
    "geom (visual)": SMALL.replace(
        '<geom name="g"', '<geom type="sphere" size=".1" contype="0" conaffinity="0"/><geom'
    ),
    "geom friction (sliding)": SMALL.replace('density="3000"', 'friction=".2"'),
    "body name": SMALL.replace('name="ball"', 'name="my/ball"'),
}


@pytest.mark.parametrize(("quantity", "text"), TOLD.items())
def test_what_is_not_carried_is_told(tmp_path: Path, quantity: str, text: str) -> None:
    told = {line.quantity for line in read(tmp_path, text).account if line.state != "carried"}
    before = {line.quantity for line in read(tmp_path).account if line.state != "carried"}
    assert quantity in told - before


def test_what_a_file_switches_off_is_told_by_name(tmp_path: Path) -> None:
    flags = '<option><flag gravity="disable" spring="disable" limit="disable"/></option>'
    text = SMALL.replace("<worldbody>", f"{flags}<worldbody>")
    (told,) = (line for line in read(tmp_path, text).account if line.quantity.endswith("leflags"))
    assert told.reason.endswith("all else acts; in the file: limit spring gravity")


EXCLUDED = "</worldbody><contact><exclude body1='box' body2='ball'/></contact>"
ALONE = [(name, "box") for name in ("post", "ball", "rock", "tool", "ground")]


@pytest.mark.parametrize(
    ("old", "new", "pairs"),
    [
        ("</worldbody>", EXCLUDED, [("ball", "box")]),
        ('name="g"', 'name="g" contype="2" conaffinity="4"', ALONE),
        ('name="floor"', 'name="floor" contype="2"', []),
        ('name="floor"', 'name="floor" contype="4" conaffinity="2"',
         [("ground", name) for name in ("box", "ball", "rock", "tool")]),
    ],
)  # fmt: skip
def test_what_masks_and_exclusions_keep_apart(
    tmp_path: Path, old: str, new: str, pairs: list[tuple[str, str]]
) -> None:
    apart = read(tmp_path, SMALL.replace(old, new)).scene.apart
    found = {frozenset(name.removeprefix("body/") for name in pair) for pair in apart}
    assert found == set(map(frozenset, pairs))


@pytest.mark.parametrize("profile", ["tuned", "file"])
def test_what_a_pair_names_collides_whatever_its_masks(tmp_path: Path, profile: str) -> None:
    unmasked = [f'name="{name}" contype="0" conaffinity="0"' for name in ("g", "floor")]
    text = SMALL.replace('name="g"', unmasked[0]).replace('name="floor"', unmasked[1])
    named = "</worldbody><contact><pair geom1='floor' geom2='g'/></contact>"
    reading = read(tmp_path, text.replace("</worldbody>", named))
    apart = {frozenset(pair) for pair in reading.scene.apart}
    box = {frozenset({"body/box", f"body/{k}"}) for k in ("post", "ball", "rock", "tool")}
    assert apart == box | {frozenset({"ground", f"body/{k}"}) for k in ("ball", "rock", "tool")}
    assert not reading.seen
    check_parity(reading.scene, profile)


@pytest.mark.parametrize("dof", ["full", "trilinear"])
def test_bodies_of_what_is_soft_alone_are_left_out(tmp_path: Path, dof: str) -> None:
    grid = 'name="jelly" type="grid" count="3 3 3" spacing=".1 .1 .1" dim="3"'
    soft = f'<flexcomp {grid} dof="{dof}"/>'
    reading = read(tmp_path, SMALL.replace("</worldbody>", soft + "</worldbody>"))
    assert reading.scene.robot is None
    assert reading.scene.bodies == read(tmp_path).scene.bodies
    assert ("flex", "jelly") in [(line.quantity, line.where) for line in reading.account]


@pytest.mark.parametrize("share", [1.0, 0.25])
def test_compensated_gravity_is_a_force(tmp_path: Path, share: float) -> None:
    text = SMALL.replace('name="box"', f'name="box" gravcomp="{share}"')
    body = read(tmp_path, text).scene.body("box")
    assert body.wrenches[0].force == pytest.approx((0, 0, 9.81 * share * body.mass))


def test_parts_whose_gravity_is_compensated_unlike_have_the_mean(tmp_path: Path) -> None:
    reading = read(tmp_path, SMALL.replace('name="tool"', 'name="tool" gravcomp="1"'))
    (held,), root = reading.scene.body("tool").wrenches, reading.model.body("tool").id
    assert held.force == pytest.approx((0, 0, 9.81 * reading.model.body_mass[root]))
    told = {line.quantity: line.where for line in reading.account}
    assert told["body gravcomp (of parts)"] == "tool"


def test_another_time_step_than_the_file_s_is_told(tmp_path: Path) -> None:
    scene = read(tmp_path, SMALL).scene
    for factor, told in ((1, 0), (2, 1)):
        found = OwnFile(scene, factor * scene.file_timestep).deviations()
        assert sum("the file asks for steps" in d.reason for d in found) == told


def test_the_file_itself_is_borne_once(tmp_path: Path) -> None:
    text = SMALL.replace('name="box"', 'name="box" gravcomp="1"')
    scene = read(tmp_path, text).scene
    simulator = loaded(MuJoCo, scene, "file")
    names = [body.name for body in scene.free_bodies]
    pushed = np.zeros((len(names), 6))
    pushed[names.index("box"), :3] = scene.body("box").wrenches[0].force
    for _ in range(50):
        simulator.push(pushed)
        simulator.step()
    states = simulator.body_state()
    assert abs(states[names.index("box"), 9]) < 1e-6
    assert states[names.index("ball"), 9] < -0.4
    assert not [name for name in wrong(simulator) if name.endswith("gravity")]
    simulator.close()


def test_the_bowl_reads_whole() -> None:
    path = Path(os.environ.get("SIMBENCH_DATA", "")) / "libero_bowl" / "bowl_on_ramekin.xml"
    if not path.is_file():
        pytest.skip("the data set libero_bowl is not here ($SIMBENCH_DATA)")
    scene = Reading(str(path)).scene
    assert [len(body.parts) for body in scene.bodies] == [1, 25, 40]
    check_parity(scene, "tuned")
    check_parity(scene, "file")
