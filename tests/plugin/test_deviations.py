"""What an engine cannot express or tell of a scene stands in its records and under the table."""

from __future__ import annotations

import pytest

from tests.plugin.inner import FALLING, records

TOLD = {
    "pybullet": [
        "body/*/gravity link/*/gravity: Bullet has one gravity for all (not told by the engine)",
        "body/*/margin link/*/margin: Bullet's collision margin; a box has it within its faces, a "
        "mesh outside (differs by at most 0.001)",
    ],
    "drake": [
        "*/restitution: Drake has no restitution; its contacts dissipate (not told by the engine)",
        "body/*/boxes: tuned: corners of free boxes are cut by 0.1 mm a face and rounded by a "
        "sphere (differs by at most 0.0002)",
    ],
    "mujoco": ["contacts are soft by design: cubes sink in and creep a little"],
}


@pytest.mark.parametrize("name", TOLD)
def test_declared_deviations_are_recorded_and_shown(pytester: pytest.Pytester, name: str) -> None:
    pytester.makepyfile(test_it=FALLING)
    result = pytester.runpytest_subprocess(
        f"--sim={name}", "--reps=1", "-v", f"--sim-output={pytester.path / 'out'}"
    )
    assert result.ret == 0
    recorded = records(pytester.path / "out")[0]["deviations"]
    page = " ".join(result.stdout.str().split())
    for text in TOLD[name]:
        assert text in recorded
        assert f"{name}: {' '.join(text.split())}" in page
