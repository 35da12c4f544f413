"""Real experiments: does the simulated motion go where the real one went?

Each repetition is one toss of a real cube that was held out: no settings were chosen on it. The
errors are 0 for a perfect simulator of exact measurements. The best simulators reach 13 to 15 % of
the cube's edge with settings fitted to these tosses (`--sim-profile real`; docs/reality.md). Change
thresholds with `--sim-threshold position_error=16`.
"""

from pytest_simbench.tasks import ArmPushing, Tossing


def test_tossing(repeat, data_set, threshold):
    result = repeat(Tossing(data_set("cube_tosses")))

    result.assert_failures_at_most(threshold("failures", 0.15))
    result.assert_at_most("position_error", threshold("position_error", 30.0))


def test_arm_pushing(repeat, data_set, threshold):
    result = repeat(ArmPushing(data_set("arm_pushes")))

    result.assert_failures_at_most(threshold("failures", 0.5))
    result.assert_at_most("displacement_error", threshold("displacement_error", 0.03))
