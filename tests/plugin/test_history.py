"""Which releases `--sim-history` means, and where their results lie."""

from __future__ import annotations

import pytest

from pytest_simbench.plugin import history
from tests.plugin.conftest import Configure

RELEASES = ["2.9.0", "3.3.6", "3.3.7", "3.4.0", "3.5.0", "3.5.1"]


@pytest.mark.parametrize(
    ("asked", "meant"),
    [("mujoco:2", ["3.5.0", "3.5.1"]), ("mujoco:2:minor", ["3.4.0", "3.5.1"]), ("mujoco:99", None)],
)
def test_the_last_releases_that_the_adapter_runs_with(
    configure: Configure, monkeypatch: pytest.MonkeyPatch, asked: str, meant: list[str] | None
) -> None:
    monkeypatch.setattr(history, "releases", lambda name: RELEASES * (name == "mujoco"))
    refused = history.adapter("mujoco").info.refused
    every = meant or [version for version in RELEASES if not refused(version)]
    config = configure(f"--sim-history={asked}")
    assert history.releases_of(config) == [f"mujoco=={version}" for version in every]
    assert history.releases_of(config) is history.releases_of(config)  # the index is asked once
    assert history.releases_of(configure()) == []


def test_a_history_needs_two_releases(
    configure: Configure, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(history, "releases", lambda name: RELEASES[-1:])
    for asked, told in (("mujoco:2", "runs with 1 of the releases"), ("gazebo:2", "of the system")):
        with pytest.raises(pytest.UsageError, match=told):
            history.releases_of(configure(f"--sim-history={asked}"))


def test_other_settings_and_machines_have_histories_of_their_own(
    configure: Configure, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = configure("--sim-history=mujoco:3", "--reps=3")
    own = history.folder_of(config, "mujoco")
    assert own.parent == config.rootpath / ".simbench" / "history"
    assert own == history.folder_of(configure("--sim-strict"), "mujoco")
    others = [configure("--sim-seed=3"), configure("--protocol=smoke"), configure("--jitter=0")]
    names = {history.folder_of(other, "mujoco").name for other in (config, *others)}
    assert len(names | {history.folder_of(config, "ode").name}) == 5
    for other in (config, *others):
        history.folder_of(other, "mujoco").mkdir(parents=True)
    assert history.on_other_machines(config, "mujoco") == ""
    monkeypatch.setattr(history, "host", lambda: {"cpu": "another"})
    assert history.on_other_machines(config, "mujoco") == (
        f"results of another machine are not reused: {own.name} in {own.parent}, this one's are in "
        f"{history.folder_of(config, 'mujoco').name}"
    )
