"""Stack 3 towers of 5 cubes out of 21, with a Franka Panda (task 1 of the reference study).

Thresholds hold for the upper end of each 95 % interval: a simulator fails when the data show that
it is worse. Change them with `--sim-threshold placed=0.8`.
"""

from pytest_simbench.tasks import Stacking


def test_stacking(repeat, threshold):
    result = repeat(Stacking())

    result.assert_failures_at_most(threshold("failures", 0.1))
    result.assert_at_least("placed", threshold("placed", 0.8))
    result.assert_at_least("at_end", threshold("at_end", 0.8))
    result.assert_at_most("untouched_moved", threshold("untouched_moved", 1.0))
