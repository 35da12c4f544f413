"""What `gymnasium.make` knows: the entry point `gymnasium.envs` calls `register` when Gymnasium is
imported, so nothing else is imported here."""

IDS = {
    "Reaching-v0": "reaching",
    "Pushing-v0": "pushing",
    "PickAndPlace-v0": "pick_and_place",
}
"""Names in Gymnasium's namespace `simbench`, and those that `make` knows."""


def register() -> None:
    """Tell Gymnasium, in the namespace that it is in."""
    from gymnasium import register as tell

    making = "pytest_simbench.gym.making"
    for name, task in IDS.items():
        kwargs = {"task": task}
        tell(name, f"{making}:make", kwargs=kwargs, vector_entry_point=f"{making}:make_vec")
