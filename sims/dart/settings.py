"""DART's settings, and how a world gets them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from pytest_simbench.simulator import PreparedRobot, Settings, lazy_import

dartpy = lazy_import("dartpy")

Detector = Literal["fcl", "ode", "bullet", "dart"]
Solver = Literal["dantzig", "pgs", "nsgs"]


class Methods(NamedTuple):
    """How the contacts of a world are found, and how it is solved."""

    detector: Detector
    solver: Solver


@dataclass(frozen=True)
class DARTSettings(Settings):
    """DART's options; defaults are the engine's own.

    Attributes:
        timestep: [s]; DART's default.
        detector: collision detector; DART's default is `fcl`, Gazebo's is `ode`.
        solver: `dantzig` (pivoting, friction pyramid), `pgs` (projected Gauss-Seidel, friction
            pyramid) or `nsgs` (block Gauss-Seidel, Coulomb's cone).
        sweeps: largest number of passes of `pgs` and `nsgs`, DART's default for `nsgs`.
        tolerance: where they stop earlier; for `nsgs` the violation of the law of contact [m/s].
        position_gain: share of the position error that the drives correct in a step; the default
            is that of gz_ros2_control, DART has none.
        sleeping: whether bodies at rest are frozen.
        split_impulse: correct penetrations by a velocity of their own.
        mesh_detector, mesh_solver: in place of detector and solver in scenes whose robot has a mesh
            on a finger; None: the same. The detector `ode` tells up to 250 contacts of a mesh and a
            box, most of them many times over.
    """

    timestep: float = 0.001
    detector: Detector = "fcl"
    solver: Solver = "dantzig"
    sweeps: int = 100
    tolerance: float = 1e-5
    position_gain: float = 0.1
    sleeping: bool = True
    split_impulse: bool = False
    mesh_detector: Detector | None = None
    mesh_solver: Solver | None = None

    def methods(self, prepared: PreparedRobot | None) -> Methods:
        """Detector and solver of a scene with this robot."""
        if prepared is None or not has_mesh_on_finger(prepared):
            return Methods(self.detector, self.solver)
        return Methods(self.mesh_detector or self.detector, self.mesh_solver or self.solver)


def has_mesh_on_finger(prepared: PreparedRobot) -> bool:
    """Whether a link that a finger's joint moves collides as a mesh."""
    fingers = set(prepared.robot.gripper.joints)
    moved = [joint.child for joint in prepared.joints if joint.name in fingers]
    return any(shape.mesh for link in moved for shape in prepared.links[link].shapes)


def set_options(world: Any, settings: DARTSettings, methods: Methods) -> None:
    """Give an empty world its time step, methods and their options."""
    constraint = dartpy.constraint
    world.setTimeStep(settings.timestep)
    kinds = dartpy.simulation.CollisionDetectorType
    world.setCollisionDetector(getattr(kinds, methods.detector.upper()))
    sleep = world.getDeactivationOptions()
    sleep.mEnabled = settings.sleeping
    world.setDeactivationOptions(sleep)
    solver = world.getConstraintSolver()
    solver.setSplitImpulseEnabled(settings.split_impulse)
    if methods.solver == "pgs":  # dartpy makes none, but DART keeps one to fall back on
        pgs = solver.getSecondaryBoxedLcpSolver()
        options = constraint.PgsBoxedLcpSolverOption()
        options.mMaxIteration = settings.sweeps
        options.mDeltaXThreshold = options.mRelativeDeltaXTolerance = settings.tolerance
        pgs.setOption(options)
        solver.setSecondaryBoxedLcpSolver(None)
        solver.setBoxedLcpSolver(pgs)
    elif methods.solver == "nsgs":
        options = constraint.NsgsFrictionSolver.Options()
        options.maxSweeps, options.tolerance = settings.sweeps, settings.tolerance
        solver.setBoxedLcpSolver(constraint.NsgsFrictionSolver(options))
