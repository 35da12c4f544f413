"""Gymnasium environments, an extra: `pip install 'pytest-simbench[gym]'`. See `making.make`.

Whoever imports this can also say `gymnasium.make("simbench/Pushing-v0", simulator=...)`.
"""

from importlib.util import find_spec

IDS = {"Reaching-v0": "reaching", "Pushing-v0": "pushing", "PickAndPlace-v0": "pick_and_place"}
"""Names in Gymnasium's namespace `simbench`, and those that `make` knows."""

if find_spec("gymnasium") is not None:  # since 1.0 it looks for no entry points
    from gymnasium import register

    for name, task in IDS.items():
        register(
            f"simbench/{name}",
            "pytest_simbench.gym.making:make",
            vector_entry_point="pytest_simbench.gym.making:make_vec",
            kwargs={"task": task},
        )
