"""What docs/pytest9.md says of pytest 9: typed settings, `strict = true`, and `--lf`."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from pytest_simbench.plugin import options
from tests.plugin.inner import run_pytest, usage_error

PAGE = Path(__file__).resolve().parents[2] / "docs" / "pytest9.md"

typed = pytest.mark.skipif(pytest.version_tuple < (9, 0), reason="pytest 9 has them")

TEST = """
    import pytest

    def test_name(simulator):
        assert simulator.case.simulator != "pybullet"

    @pytest.mark.only_sim("mujoco")
    @pytest.mark.parametrize("number", [1, 2])
    def test_number(simulator, number):
        assert number
"""


def settings(**changes: str) -> str:
    """The file on the page, with a few lines changed."""
    (text,) = re.findall(r"```toml\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    for name, value in changes.items():
        text = re.sub(rf"(?m)^{name} = .*$", f"{name} = {value}", text)
    return str(text)


@typed
def test_the_settings_of_the_page_with_strict(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        "from tests.tiny import Falling\n\ndef test_falling(repeat): repeat(Falling(0.1))"
    )
    Path("pytest.toml").write_text(settings(sim_reps='"2"'))
    result = run_pytest(pytester, passed=2)
    result.stdout.fnmatch_lines(["configfile: pytest.toml", "mujoco * of 2 *", "pybullet * of 2 *"])


@typed
@pytest.mark.parametrize(("name", "value"), [("sim_reps", "20"), ("sim", '"mujoco"')])
def test_another_type_is_one_sentence(pytester: pytest.Pytester, name: str, value: str) -> None:
    Path("pytest.toml").write_text(settings(**{name: value}))
    with pytest.raises(pytest.UsageError, match=rf"^the ini option {name}: .* expects a "):
        options.values(pytester.parseconfig())


@typed
def test_strict_knows_the_marks_the_options_and_the_ids(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(TEST)
    Path("pytest.toml").write_text(settings())
    result = run_pytest(pytester, "--collect-only -q", ret=0)
    result.stdout.fnmatch_lines(
        ["*test_name[[]mujoco-headless]", "*test_number[[]*-2]", "*test_name[[]pybullet-headless]"]
    )
    Path("pytest.toml").write_text(settings().replace("sim_reps", "sim_repz"))
    result = run_pytest(pytester, "--collect-only -q")
    usage_error(result, "*Unknown config option: sim_repz*")


def test_last_failed_runs_a_test_on_the_simulators_on_which_it_failed(
    pytester: pytest.Pytester,
) -> None:
    pytester.makepyfile(TEST)
    sims = "--sim=mujoco,pybullet"
    run_pytest(pytester, "", sims, passed=3, failed=1)
    again = run_pytest(pytester, "--lf", sims, failed=1)
    again.stdout.fnmatch_lines(["FAILED *test_name[[]pybullet-headless]*"])
    other = run_pytest(pytester, "--sim=mujoco --lf", passed=3)
    other.stdout.fnmatch_lines(["*1 known failures not in selected tests*"])
