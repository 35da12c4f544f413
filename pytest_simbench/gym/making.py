"""Environments by name: `make("pushing", "mysim")`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from pytest_simbench.cli.values import BadInput, refusing
from pytest_simbench.client.environments import missing
from pytest_simbench.experiment.case import Case
from pytest_simbench.ground.errors import SimulatorError
from pytest_simbench.motion.errors import RobotError
from pytest_simbench.motion.registry import find
from pytest_simbench.scene import Robot
from pytest_simbench.scene.checks import SceneError, check_number
from pytest_simbench.scene.policy import Rhythm
from pytest_simbench.simulator import Capability
from pytest_simbench.simulator.registry import adapter, settings_of
from pytest_simbench.tasks.goals import GoalTask, PickAndPlace, PushingToGoal, Reaching

TASKS: dict[str, Any] = {
    "reaching": Reaching,
    "pushing": PushingToGoal,
    "pick_and_place": PickAndPlace,
}

RATE = 10.0
"""How often an environment acts [Hz]: whole time steps of each engine's `tuned` profile."""


def make(
    task: str | GoalTask,
    simulator: str,
    *,
    num_envs: int | None = None,
    actions: str = "tool",
    reward: str = "dense",
    profile: str = "tuned",
    jitter: float = 1.0,
    robot: str | Path | Robot | None = None,
    render_mode: str | None = None,
    python: str | None = None,
    **parameters: Any,
) -> Any:
    """A `gymnasium.Env` of one task on one simulator, see `gym.env.TaskEnv`.

    Args:
        task: a name of `TASKS`, or a task of a goal; its policy is not asked.
        num_envs: None; or so many at once, as a `gymnasium.vector.VectorEnv`.
        actions: `tool`: it moves along x, y, z and turns about the vertical; `joints`: they move.
        reward: `dense`: minus the distance [m]; `sparse`: 0 at the goal, else -1.
        jitter: scale of the start jitter; 1 is 1 mm and 1 degree.
        robot: a name, a robot file, or a robot; default: the task's own.
        render_mode: `rgb_array`: each step also takes a picture.
        python: interpreter of the workers; default: the engine's own, or this one.
        parameters: of the task in place of its own: `rate` [Hz], `seconds`, `tolerance` [m],
            `command_latency`, `observation_delay` [s].

    Raises:
        BadInput: what cannot be, in one sentence with the valid choices.
    """
    if find_spec("gymnasium") is None:
        raise BadInput("environments need Gymnasium: pip install 'pytest-simbench[gym]'")
    from pytest_simbench.gym.env import ACTIONS, REWARDS, TaskEnv
    from pytest_simbench.gym.vector import TaskVectorEnv

    _choose("actions", actions, ACTIONS)
    _choose("reward", reward, REWARDS)
    _choose("render_mode", render_mode, (None, "rgb_array"))
    if num_envs is not None and (not isinstance(num_envs, int) or num_envs < 1):
        raise BadInput(f"num_envs={num_envs!r:.60}: give a whole number from 1 on")
    chosen: Any = task
    if not isinstance(task, GoalTask):
        chosen = TASKS[_choose("task", task, TASKS)](None)
    taken = {item.name for item in fields(chosen)} - {"policy", "inside", "settle"}
    for name in parameters:
        _choose("parameter", name, taken)
    with refusing((SimulatorError, SceneError, RobotError)):
        chosen = replace(chosen, **{"rate": chosen.rate or RATE, **parameters})
        if robot is not None:
            chosen = chosen.on(robot if isinstance(robot, Robot) else find(str(robot)))
        check_number(chosen.seconds, "the seconds of an episode", 0.0, above=True)
        check_number(jitter, "the jitter", 0.0)
        info = adapter(str(simulator)).info
        rhythm = Rhythm(chosen.rate, chosen.command_latency, chosen.observation_delay)
        case = Case.of(
            simulator, python=python, test=chosen.name, mode="headless", profile=profile,
            jitter=jitter, folder=Path(),
        )  # fmt: skip
        rhythm.steps(settings_of(simulator, case.base, case.changes).timestep)
    if (problem := chosen.problem()) or (python is None and (problem := missing(info))):
        raise BadInput(problem)
    if render_mode and Capability.OFFSCREEN not in info.capabilities:
        raise BadInput(f"{simulator} draws no pictures outside a window: leave render_mode out")
    made = partial(TaskEnv, chosen, case, rhythm, actions, reward, render_mode)
    return made() if num_envs is None else TaskVectorEnv([made() for _ in range(num_envs)])


def make_vec(task: str | GoalTask, simulator: str, num_envs: int = 1, **options: Any) -> Any:
    """So many environments at once; arguments and errors as `make`."""
    return make(task, simulator, num_envs=num_envs, **options)


def _choose(name: str, value: Any, choices: Iterable[Any]) -> Any:
    known = sorted(choices, key=str)
    if value not in known:
        raise BadInput(f"{name}={value!r:.60}: choose from {', '.join(map(str, known))}")
    return value
