"""Motion planning: joint moves, straight lines, finger motions and the throw, as trajectories.

A joint move is tried directly; when it collides, OMPL's RRTConnect searches a path, and way points
that are not needed are cut out. OMPL draws from generators that its own global seed
generator seeds, and its simplifier stops by the clock, so for the same plan from the same seed
every time the global seed is set anew before each search, searches end by a counted number
of checks, and the shortcuts are our own.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
from ompl import base, geometric, util

from pytest_simbench.motion.collision import PlanningScene
from pytest_simbench.motion.errors import PlanningError
from pytest_simbench.motion.kinematics import DECIMALS, straight_line, tool_path
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.throw import Throw, feasible_swing, released
from pytest_simbench.motion.timing import TICK, Timed, along_path, straight_move, synchronised_move
from pytest_simbench.scene import FloatArray, Pose, Trajectory

CHECK_SPACING = 0.02
"""Farthest that the hand moves between two collision checks [m]. The planning scene's margin is
more than half of it, so nothing is brushed in between. Both go with the scene's scale."""

BEYOND = 1e-3
"""How far beyond its limits an arm may be told to stand [rad, m]: less than drives hold."""

MAX_CHECKS = 20_000
"""Collision checks after which a search gives up, about 2 s."""

_OMPL = threading.Lock()
"""OMPL's seed is global: one search at a time."""


class MotionPlanner:
    """Plans trajectories of one robot in one planning scene.

    Args:
        rng: of the repetition; drives everything random in planning.
        gravity: for the feed-forward [m/s^2].
    """

    def __init__(
        self,
        model: RobotModel,
        scene: PlanningScene,
        rng: np.random.Generator,
        gravity: Iterable[float],
    ) -> None:
        self.model = model
        self.limits = model.limits
        self.levers = self.limits.column("levers")
        self.scene = scene
        self.rng = rng
        self.gravity = np.array(list(gravity))
        self._spacing = CHECK_SPACING * scene.scale

    def move_to(
        self, start: FloatArray, goal: FloatArray, fingers: float, *, speed: float = 1.0
    ) -> Trajectory:
        """Collision-free motion between two arm positions, fingers commanded to stay.

        Raises:
            PlanningError: start or goal touch something or lie beyond the joints' limits, `speed`
                is no share, or no way was found.
        """
        low, high = self.model.lower, self.model.upper
        for what, arm in (("start", start), ("goal", goal)):
            off = np.maximum(low - arm, arm - high)
            if off.max() > BEYOND:
                name = self.model.robot.joints[off.argmax()].name
                raise PlanningError(f"{what} {off.max():.2g} rad or m beyond the limits of {name}")
            touching = self.scene.collision(arm)
            if touching is not None:
                raise PlanningError(f"{what} in collision: {' and '.join(touching)}")
        direct = straight_move(start, goal, self.limits, speed=speed)
        if self.scene.first_collision(self._thinned(direct.position)) is None:
            return self.set_points(direct, fingers)
        first, last = np.clip([start, goal], low, high)  # OMPL waits for ever for what is beyond
        with _OMPL:
            path = self._search(first, last, int(self.rng.integers(1, 2**31)))
        path[[0, -1]] = start, goal
        path = self._shortened(path)
        parts = [straight_move(a, b, self.limits, speed=speed) for a, b in pairwise(path)]
        whole = Timed(*map(np.concatenate, zip(*parts, strict=True)))
        return self.set_points(whole, fingers)

    def move_linear(
        self,
        start: FloatArray,
        target: Pose,
        fingers: float,
        *,
        ignored: Iterable[str],
        speed: float,
    ) -> Trajectory:
        """The tool on a straight line to a pose; `ignored` bodies may be touched.

        Raises:
            Unreachable: the line leaves the workspace.
            PlanningError: something else is in the way.
        """
        path = straight_line(self.model, start, target)
        timed = along_path(path, self.limits, speed=speed)
        return self._touching_only(timed, fingers, ignored, "straight line")

    def move_along(
        self,
        start: FloatArray,
        poses: Sequence[Pose],
        fingers: float,
        *,
        tool_speed: float,
        ignored: Iterable[str] = (),
    ) -> Trajectory:
        """The tool through poses that lie close to each other; `ignored` bodies may be touched.

        Args:
            poses: of the tool in the world, about 1 cm from each other.
            tool_speed: mean speed of the tool centre point [m/s]; slower where the joints' limits
                ask for it.

        Raises:
            Unreachable: the path leaves the workspace.
            PlanningError: something else is in the way.
        """
        path = tool_path(self.model, start, poses)
        points = [self.model.tool_pose(start).position, *(pose.position for pose in poses)]
        length = float(np.linalg.norm(np.diff(np.array(points), axis=0), axis=1).sum())
        timed = along_path(path, self.limits)
        if length and timed.duration:  # else the tool turns on the spot, or stays
            share = min(1.0, timed.duration * tool_speed / length)
            timed = along_path(path, self.limits, speed=share)
        return self._touching_only(timed, fingers, ignored, "path")

    def _touching_only(
        self, timed: Timed, fingers: float, ignored: Iterable[str], what: str
    ) -> Trajectory:
        """The trajectory of a motion that may touch the bodies in `ignored` and nothing else."""
        touching = self.scene.first_collision(
            self._thinned(timed.position), ignored=ignored, margin=False
        )
        if touching is not None:
            raise PlanningError(f"{what} blocked: {' and '.join(touching)}")
        return self.set_points(timed, fingers)

    def move_fingers(
        self, arm: FloatArray, opening: float, target: float, hold: float
    ) -> Trajectory:
        """Fingers from `opening` to `target` [m, or rad] at their speed, then `hold` [s] more."""
        steps = int(np.ceil(abs(target - opening) / self.limits.finger_speed / TICK))
        rows = steps + int(np.ceil(hold / TICK)) + 1
        ramp = np.interp(np.arange(rows), [0, max(1, steps)], [opening, target])
        still = np.zeros((rows, self.model.arm))
        timed = Timed(np.tile(arm[: self.model.arm], (rows, 1)), still, still)
        return self.set_points(timed, ramp)

    def throw(
        self,
        start: FloatArray,
        goal: FloatArray,
        closed: float,
        opened: float,
        fraction: float,
        *,
        feasible: bool = True,
    ) -> tuple[Trajectory, Throw]:
        """A swing from start to goal, the fingers opened at `fraction` of its duration.

        Args:
            feasible: within the limits of the motors; else as the reference study swings.
        """
        timed, duration = (
            feasible_swing(self.model, start, goal, self.gravity, self.scene.held_body)
            if feasible
            else synchronised_move(start, goal, self.limits)
        )
        throw = released(self.model, timed, duration, fraction, self.scene.scale)
        fingers = np.where(np.arange(len(timed.position)) >= throw.row, opened, closed)
        return self.set_points(timed, fingers), throw

    def set_points(self, timed: Timed, fingers: float | FloatArray) -> Trajectory:
        """Set points of all joints with feed-forward efforts."""
        rows, robot = len(timed.position), self.model.robot
        others = self.model.pin.nq - self.model.arm
        column = np.broadcast_to(np.asarray(fingers, dtype=float), (rows,))[:, None]
        position = np.hstack([timed.position, np.repeat(column, others, axis=1)])
        padding = np.zeros((rows, others))
        velocity = np.hstack([timed.velocity, padding])
        acceleration = np.hstack([timed.acceleration, padding])
        effort = self.model.inverse_dynamics(self.gravity, position, velocity, acceleration)
        effort[:, self.model.arm :] = 0.0  # the squeeze is the fingers' own drive alone
        beside = np.zeros((rows, len(robot.beside)))
        still = beside + robot.column("initial_position")[self.model.pin.nq :]
        parts = ((position, still), (velocity, beside), (effort, beside))
        told = (np.hstack(p).round(n) + 0.0 for p, n in zip(parts, DECIMALS, strict=True))
        return Trajectory(TICK, *told)

    def _search(self, start: FloatArray, goal: FloatArray, seed: int) -> FloatArray:
        """RRTConnect from start to goal, way points (n, arm)."""
        util.setLogLevel(util.LogLevel.LOG_NONE)
        util.RNG.setSeed(seed)
        arm = self.model.arm
        space = base.RealVectorStateSpace(arm)
        bounds = base.RealVectorBounds(arm)
        bounds.low, bounds.high = self.model.lower.tolist(), self.model.upper.tolist()
        space.setBounds(bounds)
        information = base.SpaceInformation(space)
        checks = 0

        def valid(state: base.State) -> bool:
            nonlocal checks
            checks += 1
            at = np.array([state[i] for i in range(arm)])
            # `move_to` looked at the ends. OMPL waits for ever for a goal that it finds invalid.
            return bool((at == start).all() or (at == goal).all()) or (
                self.scene.collision(at) is None
            )

        information.setStateValidityChecker(valid)
        information.setStateValidityCheckingResolution(
            self._spacing / float(np.linalg.norm(self.levers)) / space.getMaximumExtent()
        )
        information.setup()
        problem = base.ProblemDefinition(information)
        states = [information.allocState() for _ in range(2)]
        for state, values in zip(states, (start, goal), strict=True):
            for i in range(arm):
                state[i] = float(values[i])
        problem.setStartAndGoalStates(*states)
        planner = geometric.RRTConnect(information)
        planner.setRange(0.8)
        planner.setProblemDefinition(problem)
        planner.setup()
        planner.solve(base.PlannerTerminationCondition(lambda: checks > MAX_CHECKS))
        path = problem.getSolutionPath()
        if path is None or problem.hasApproximateSolution():
            raise PlanningError(f"no path found in {checks} checks")
        count = path.getStateCount()
        return np.array([[path.getState(k)[i] for i in range(arm)] for k in range(count)])

    def _shortened(self, path: FloatArray) -> FloatArray:
        """The path without the way points that a straight, free segment can skip."""
        points = list(path)
        at = 0
        while at < len(points) - 2:
            for skip in range(len(points) - 1, at + 1, -1):
                segment = self._segment(points[at], points[skip])
                if self.scene.first_collision(segment) is None:
                    del points[at + 1 : skip]
                    break
            at += 1
        return np.array(points)

    def _segment(self, a: FloatArray, b: FloatArray) -> FloatArray:
        """Positions between a and b to check, both ends among them."""
        steps = max(1, int(np.ceil(self.levers @ np.abs(b - a) / self._spacing)))
        return np.asarray(a + np.linspace(0.0, 1.0, steps + 1)[:, None] * (b - a))

    def _thinned(self, rows: FloatArray) -> FloatArray:
        """Rows between which the hand moves at most the spacing, first and last among them."""
        ways = np.abs(np.diff(rows, axis=0)) @ self.levers
        travelled = np.concatenate([[0.0], np.cumsum(ways)])
        wanted = np.arange(0.0, travelled[-1], self._spacing)
        picked = np.unique(np.searchsorted(travelled, wanted))
        return np.vstack([rows[picked], rows[-1:]])
