"""Real experiments: does the simulated motion go where the real one went?

    pytest suites/test_reality.py --sim=all --sim-profile=real

Each repetition is a real toss, impact, push or motion of an arm that was held out: no settings were
chosen on it. The errors are 0 for a perfect simulator of exact measurements (docs/reality.md). A
simulator that misses a bar fails, and that is a finding.

The bars of the profile `real`, whose settings were chosen on the other half:

- tosses: 16 % of the cube's edge. The best published simulators have 13.5 and 14.9 %.
- impacts: the velocity after is off by 0.26 m/s on average. Who always says the mean of the other
  half is off by twice that, the best law of impacts by half.
- pushes: the cube goes as far as the real one, within 5 mm of 95 mm on average, and turns like it
  within 3 degrees.
- commands: the hand is off by 30 mm on average, like the best of the source's seven simulations
  (28 mm where the arm pushes); by 10 mm where the arm's own errors are calibrated.

Other profiles know nothing of these data. They are judged by what was published before: tosses by
25.1 %, the worst of the simulators there; pushes by 19 mm, the best of the source's simulations
that push the cube at all; commands alike; impacts by that mean, 0.53 m/s. Change bars with
`--sim-threshold position_error=13.5`.
"""

from dataclasses import replace

from pytest_simbench.tasks import (
    ArmFollowing,
    ArmPushing,
    CorrectedArmFollowing,
    Impacting,
    Tossing,
)

SURFACES = {
    "mujoco": (0.16, 0.35),
    "sapien": (0.12, 0.55),
    "drake": (0.2, 0.0),
}
"""Friction and restitution of the square and its table: the best of 56 pairs for each simulator,
with `real`, on the impacts that are not held out. The task's suit PyBullet, DART, ODE, and a law of
impacts; others were not searched, and take them too."""


def test_tossing(repeat, data_set, threshold):
    result = repeat(Tossing(data_set("cube_tosses")))

    result.assert_crashed_at_most(threshold("crashed", 0.15))
    if _is_real(result):
        result.assert_at_most("position_error", threshold("position_error", 16.0))
    else:
        result.assert_at_most("position_error", threshold("position_error", 25.1))


def test_impacting(repeat, sim_case, data_set, threshold):
    task = Impacting(data_set("planar_impacts"))
    friction, restitution = SURFACES.get(sim_case.simulator, (task.friction, task.restitution))
    result = repeat(replace(task, friction=friction, restitution=restitution))

    result.assert_crashed_at_most(threshold("crashed", 0.15))
    if _is_real(result):
        result.assert_at_most("velocity_error", threshold("velocity_error", 0.26))
    else:
        result.assert_at_most("velocity_error", threshold("velocity_error", 0.53))


def test_arm_pushing(repeat, data_set, threshold):
    task = ArmPushing(data_set("arm_pushes"))
    result = repeat(task)

    off = threshold("displacement_error", 0.005 if _is_real(result) else 0.019)
    real = task.references["displacement"]
    result.assert_between("displacement", real - off, real + off)
    if _is_real(result):
        result.assert_at_most("turn_error", threshold("turn_error", 3.0))


def test_arm_following(repeat, data_set, threshold):
    result = repeat(ArmFollowing(data_set("arm_pushes")))

    result.assert_at_most("hand_error", threshold("hand_error", 0.03))


def test_arm_following_corrected(repeat, data_set, threshold):
    result = repeat(CorrectedArmFollowing(data_set("arm_pushes")))

    result.assert_at_most("hand_error", threshold("hand_error", 0.01))


def _is_real(result):
    return result.records[0].profile == "real"
