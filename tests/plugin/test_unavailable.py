"""What the machine lacks is a skip with a reason, shown with SAPIEN's window: it takes Vulkan."""

from __future__ import annotations

import shutil

import pytest

from tests.plugin.inner import run_pytest

pytest.importorskip("sapien")


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="no Xvfb: apt-get install xvfb")
def test_without_a_vulkan_device_a_window_is_a_skip_and_no_failed_repetition(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("VK_DRIVER_FILES", "VK_ICD_FILENAMES"):
        monkeypatch.setenv(name, str(pytester.path / "none.json"))
    pytester.makepyfile(
        """
        from pytest_simbench.tasks import Jitter
        from tests.tiny import Falling

        def test_repeated(repeat):
            repeat(Falling()).assert_at_least("landed", 0.1)

        def test_by_hand(simulator):
            with simulator.episode(Falling().scene(0, Jitter())) as world:
                world.wait(0.1)
        """
    )
    arguments = ("--sim=sapien", "--reps=2", "--sim-output=out", "-rs")
    result = run_pytest(pytester, "--gui", *arguments, skipped=2)
    result.stdout.fnmatch_lines(["*SAPIEN draws with Vulkan*mesa-vulkan-drivers*"])
    assert not (pytester.path / "out" / "records.jsonl").exists()
    run_pytest(pytester, "", *arguments, passed=2)
