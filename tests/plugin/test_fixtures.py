"""The interactive fixtures, under Hypothesis too."""

from __future__ import annotations

import pytest

from tests.plugin.inner import run_pytest


def test_simulator_is_safe_under_hypothesis(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        from hypothesis import given, settings, strategies as st
        from pytest_simbench.scene import Box, Pose, Scene

        pids = set()

        @settings(max_examples=5, deadline=None)
        @given(height=st.floats(0.1, 0.5))
        def test_falls(simulator, height):
            cube = Box("cube", (0.05, 0.05, 0.05), Pose.at(0, 0, height), mass=0.1)
            with simulator.episode(Scene("s", (cube,))) as world:
                world.wait(1.0)
                assert abs(world.pose("cube").position[2] - 0.025) < 0.002
                pids.add(world.process.pid)

        def test_worker_was_reused():
            assert len(pids) == 2  # one for each simulator
        """
    )
    run_pytest(pytester, "--sim=mujoco,pybullet -p no:randomly", passed=3)


def test_settings_and_resources(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        import time
        import pytest
        from pytest_simbench.scene import Scene

        @pytest.fixture
        def sim_settings():
            return {"timestep": 0.005}

        def test_it(sim, resources, output_path):
            world = sim(Scene("s"))
            use = resources(world)
            world.wait(0.005)
            assert world.stats()["stepping"]["steps"] == 1
            time.sleep(0.5)
            assert use.stop().rss_mb.mean > 20
            assert output_path.is_dir()
        """
    )
    run_pytest(pytester, "--sim=mujoco", passed=1)
