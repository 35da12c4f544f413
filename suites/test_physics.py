"""Every simulator against laws whose right answer is known (docs/truth.md).

    pytest suites/test_physics.py --sim=all
    pytest suites/test_physics.py --sim=all -k "slide or stick"
    pytest suites/test_physics.py --sim=all --sim-profile=default,tuned
    pytest suites/test_physics.py --sim=all --sim-sweep

A law that a simulator breaks is a finding, with its size, and no failure: it is in the tables. A
test fails when its repetition crashes: its world diverges, for instance. `--sim-threshold ratio=1`
makes each law that is broken fail, `ratio=10` each that is missed by ten tolerances. A law draws
nothing: a simulator that is deterministic repeats it once, whatever `--reps` says.

`--sim-sweep` asks the same of other time steps: what a simulator cannot do there is a finding, too.
"""

import pytest

from pytest_simbench.laws import LAWS

pytestmark = pytest.mark.reps(1)

ANY = 1e12
"""No law is missed by so many tolerances: nothing fails for it."""


def asked(law):
    marks = [pytest.mark.needs(*law.needs)] if law.needs else []
    return pytest.param(law, id=law.name, marks=marks)


@pytest.mark.repeats("law")
@pytest.mark.parametrize("law", [asked(law) for law in LAWS])
def test_law(repeat, threshold, law):
    limit = threshold("ratio", ANY)
    result = repeat(law)
    worst = max(result.values("ratio"), default=0.0)
    assert worst <= limit, f"{result.label}: off by {worst:.3g} tolerances"
