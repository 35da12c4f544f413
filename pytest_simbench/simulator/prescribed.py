"""Bodies that move as prescribed, for engines that know none.

Such an engine gets a free body that nothing moves: so heavy that what touches it hardly changes
its velocity, alike about all axes so that it turns steadily, and without weight.
`Simulator.lead` gives it its state before each step.
"""

from __future__ import annotations

from pytest_simbench.scene import Scene

TIMES = 1e4
"""What strikes such a body moves it by this part of its own change of velocity, for one step. With
more, solvers lose digits: in one engine a cube of 0.2 kg jitters at 20 mm/s on a belt of 1e7 kg."""


def heavy(scene: Scene) -> float:
    """Its mass [kg] and its moments of inertia [kg m^2]: many times those of any other body."""
    return TIMES * max([1.0, *(body.mass for body in scene.bodies)])
