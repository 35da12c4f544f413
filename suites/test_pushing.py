"""Push a block 20 cm with the closed hand, along a line and round a curve.

A simulator fails when the data show that it is worse than a threshold. By quasi-static theory the
block stays at rest against the hand, so its errors are 0 but for the jitter of its start (1 mm).
Change thresholds with `--sim-threshold position_error=0.005`.
"""

from pytest_simbench.tasks import CurvePushing, Pushing


def test_pushing(repeat, threshold):
    check(repeat(Pushing()), threshold)


def test_pushing_curve(repeat, threshold):
    check(repeat(CurvePushing()), threshold)


def check(result, threshold):
    result.assert_crashed_at_most(threshold("crashed", 0.15))
    result.assert_at_most("position_error", threshold("position_error", 0.01))
    result.assert_at_most("heading_error", threshold("heading_error", 5.0))
    result.assert_at_most("path_error", threshold("path_error", 0.01))
    result.assert_at_most("tipped", threshold("tipped", 0.2))
