"""Throw a cube at a pyramid of six, with a Franka Panda (task 2 of the reference study).

Thresholds hold for the upper end of each 95 % interval: a simulator fails when the data show that
it is worse. Change them with `--sim-threshold hit=0.5`.
"""

from pytest_simbench.tasks import Throwing


def test_throwing(repeat, threshold):
    result = repeat(Throwing())

    result.assert_failures_at_most(threshold("failures", 0.1))
    result.assert_at_least("hit", threshold("hit", 0.8))
    result.assert_at_least("moved", threshold("moved", 0.1))
