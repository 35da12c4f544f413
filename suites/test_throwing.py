"""Throw a cube at a pyramid of six, with a Franka Panda (task 2 of the reference study).

A simulator fails when the data show that it is worse than a threshold. With 20 repetitions one that
hits with 80 % passes, one with 62 % half of the time, and one with 44 % one time in twenty;
failures of 15 % or less are supported when there is none (docs/gate.md). Change thresholds with
`--sim-threshold hit=0.5`.
"""

from pytest_simbench.tasks import Throwing


def test_throwing(repeat, threshold):
    result = repeat(Throwing())

    result.assert_crashed_at_most(threshold("crashed", 0.15))
    result.assert_at_least("hit", threshold("hit", 0.8))
    result.assert_at_least("moved", threshold("moved", 0.2))
