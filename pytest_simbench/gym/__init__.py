"""Gymnasium environments, an extra: `pip install 'pytest-simbench[gym]'`. See `making.make`."""

IDS = {"Reaching-v0": "reaching", "Pushing-v0": "pushing", "PickAndPlace-v0": "pick_and_place"}
"""Names in Gymnasium's namespace `simbench`, and those that `make` knows."""


def register() -> None:
    """Called by Gymnasium, in that namespace, when it is imported itself."""
    from gymnasium import register as tell

    made = "pytest_simbench.gym.making:make"
    for name, task in IDS.items():
        tell(name, made, kwargs={"task": task}, vector_entry_point=f"{made}_vec")
