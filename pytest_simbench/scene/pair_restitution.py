"""A scene whose surfaces have different restitutions: every engine makes one of two in its way."""

from __future__ import annotations

from pytest_simbench.scene.scene import Scene


def unlike(scene: Scene) -> str:
    """A sentence where restitutions of the ground, the bodies and the robot (0) differ, else
    empty."""
    own = {scene.ground_restitution, *(body.restitution for body in scene.bodies)}
    own |= set() if scene.robot is None else {0.0}
    if len(own) == 1:
        return ""
    told = ", ".join(f"{value:g}" for value in sorted(own))
    return (
        f"how two surfaces of different restitution ({told}) bounce is the engine's own: no rule "
        "of the scene says it"
    )
