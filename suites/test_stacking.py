"""Stack 3 towers of 5 cubes out of 21, with a Franka Panda (task 1 of the reference study).

A simulator fails when the data show that it is worse than a threshold. With 20 repetitions one that
places 80 % passes, one that loses every other stacking passes half of the time, and one that loses
two of three, or fails in half of its repetitions, one time in twenty; failures of 15 % or less are
supported when there is none (docs/gate.md). Change thresholds with `--sim-threshold placed=0.8`.
"""

from pytest_simbench.tasks import Stacking


def test_stacking(repeat, threshold):
    result = repeat(Stacking())

    result.assert_crashed_at_most(threshold("crashed", 0.15))
    result.assert_at_least("placed", threshold("placed", 0.8))
    result.assert_at_least("at_end", threshold("at_end", 0.8))
    result.assert_at_most("untouched_moved", threshold("untouched_moved", 1.0))
