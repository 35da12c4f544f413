"""The robot on the study's table."""

from __future__ import annotations

import numpy as np
import pytest

from pytest_simbench.motion.collision import PlanningScene
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import READY, panda
from pytest_simbench.motion.planning import MotionPlanner
from pytest_simbench.scene import FloatArray, Scene
from pytest_simbench.tasks import Jitter, Stacking


@pytest.fixture(scope="session")
def model() -> RobotModel:
    return RobotModel(panda())


@pytest.fixture(scope="session")
def ready() -> FloatArray:
    return np.array(READY)


@pytest.fixture
def scene() -> Scene:
    return Stacking().scene(0, Jitter(0.0, 0.0))


@pytest.fixture
def planner(model: RobotModel, scene: Scene) -> MotionPlanner:
    planning = PlanningScene(model, scene)
    return MotionPlanner(model, planning, np.random.default_rng(1), scene.gravity)
