"""What the conftest at the top does for suites and tests."""

from __future__ import annotations

import pytest


@pytest.mark.parametrize(
    ("test", "group"),
    [
        ("suites/test_stacking.py::test_stacking[newton-headless]", "newton"),
        ("tests/sims/test_genesis.py::test_fault_is_caught", "genesis"),
        ("tests/sims/test_faults.py::test_it[genesis-ground/height]", "genesis"),
        (
            "suites/test_stacking.py::test_stacking[mujoco-headless]",
            "test_stacking.py mujoco",
        ),
        ("tests/report/page/test_browser.py::test_it_opens", "browser"),
        (
            "tests/scene/test_scene.py::test_a_turn[x/y]",
            "tests/scene/test_scene.py::test_a_turn[x/y]",
        ),
    ],
)
def test_tests_that_share_what_is_slow_run_in_one_process(
    request: pytest.FixtureRequest, test: str, group: str
) -> None:
    top = request.config.pluginmanager.get_plugin(str(request.config.rootpath / "conftest.py"))
    assert top is not None
    assert top.group(test) == group


def test_xdist_is_asked_to_do_so(pytester: pytest.Pytester, request: pytest.FixtureRequest) -> None:
    """With `--dist loadgroup` alone; else its own order holds."""
    pytester.makeconftest((request.config.rootpath / "conftest.py").read_text())
    pytester.makepyfile(
        """
        import os
        import pytest

        @pytest.mark.parametrize("name", ["genesis-a", "x", "genesis-b", "y", "genesis-c", "z"])
        def test_it(name):
            print(f"ran {name} in {os.environ['PYTEST_XDIST_WORKER']}")
        """
    )
    result = pytester.runpytest_subprocess("-n", "2", "--dist", "loadgroup", "-rP")
    result.assert_outcomes(passed=6)
    lines = [line.split() for line in result.outlines if line.startswith("ran genesis")]
    assert len({worker for *_, worker in lines}) == 1
    assert len(lines) == 3
