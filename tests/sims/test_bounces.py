"""What a spring and a damper leave of the speed of a mass, against the motion itself."""

from __future__ import annotations

import pytest

from sims.mujoco.bounces import LARGEST, damping_ratio, direct, restitution_of


def left(stiffness: float, damping: float) -> float:
    """Share of its speed with which a mass leaves such a contact: at the end of their force."""
    x, v, dt = 0.0, 1.0, 1e-6
    while stiffness * x + damping * v > 0:
        v -= (stiffness * x + damping * v) * dt
        x += v * dt
    return -v


@pytest.mark.parametrize("restitution", [0.25, 0.6, 0.95])
def test_a_contact_leaves_what_it_is_made_for(restitution: float) -> None:
    stiffness, damping = direct(restitution, 0.002)
    assert left(-stiffness, -damping) == pytest.approx(restitution, abs=1e-3)
    assert restitution_of(damping_ratio(restitution)) == pytest.approx(restitution)


def test_all_and_nothing() -> None:
    assert restitution_of(0.0) == 1.0
    assert damping_ratio(1.0) == pytest.approx(0.0, abs=1e-12)
    assert restitution_of(1.0) == restitution_of(LARGEST) == 0.0
    assert restitution_of(damping_ratio(0.1)) == pytest.approx(0.2079, abs=1e-3)
