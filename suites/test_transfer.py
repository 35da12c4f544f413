"""Policies on every simulator: does a policy that was made on one keep its skill on another, and do
all simulators rank policies alike?

    pytest suites/test_transfer.py --sim=all
    pytest suites/test_transfer.py --sim=all --policies mine.py,other.py:second
    pytest suites/test_transfer.py --sim=all -k delay

The shipped policies (suites/policies) are controllers of a few numbers, found on one engine each,
beside one written by hand and one that does nothing. What they see of a body is off by millimetres,
and the time and the place that counts are small: close skills are what a ranking is hard for.
A policy of a file may say for which `task` it is, `pushing` or `picking`; else it does both.
A policy that fails is a finding, and no failure: a test fails when its repetitions crash.
"""

import pytest

from pytest_simbench import Policy
from pytest_simbench.tasks import PickAndPlace, PushingToGoal

TIME = {"pushing": 5.0, "picking": 3.5}
"""That a policy has [s]. A hand-written one takes nine tenths of it."""

TOLERANCE = {"pushing": 0.01, "picking": 0.006}
"""Of the place [m]. What a shipped policy sees is off by 5 mm along x and y (standard deviation);
fingers that close put a cube right along one of them."""

DELAYS = {"late0": {}} | {
    f"{name}{periods}": {delay: periods}
    for name, delay in (("late", "command_latency"), ("old", "observation_delay"))
    for periods in (1, 2, 4)
}
"""Periods of a policy, by which its commands come late, or what it is shown is old."""


def pushing(policy, **more):
    return PushingToGoal(policy, seconds=TIME["pushing"], tolerance=TOLERANCE["pushing"], **more)


def picking(policy, **more):
    return PickAndPlace(policy, seconds=TIME["picking"], tolerance=TOLERANCE["picking"], **more)


TASKS = {"pushing": pushing, "picking": picking}


@pytest.mark.policies("pushing")
def test_pushing(repeat, policy):
    repeat(pushing(policy))


@pytest.mark.policies("picking")
def test_picking(repeat, policy):
    repeat(picking(policy))


@pytest.mark.policies("pushing", "scripted")
@pytest.mark.parametrize("delay", DELAYS)
def test_pushing_with_delay(repeat, policy, delay):
    rate = getattr(policy, "rate", Policy.rate)
    repeat(pushing(policy, **{name: k / rate for name, k in DELAYS[delay].items()}))
