"""`pytest tests -m "not engine"`: what is left out, and that CI runs it without any simulator."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

from pytest_simbench.testing import CHECKS
from tests import conftest

ROOT = Path(__file__).resolve().parents[2]
CI = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text("utf-8"))


def marks(file: str, *fixtures: str, name: str = "test_it") -> list[str]:
    found: list[str] = []
    path = Path(conftest.__file__).parent / file
    item: Any = SimpleNamespace(
        path=path, name=name, fixturenames=fixtures, add_marker=found.append
    )
    conftest.pytest_itemcollected(item)
    return found


@pytest.mark.parametrize(
    ("file", "fixtures", "expected"),
    [
        ("sims/test_contract.py", (), ["engine"]),
        ("testing/test_checks.py", (), ["engine"]),
        ("report/page/test_browser.py", (), ["engine"]),
        ("client/test_faults.py", ("tmp_path", "case"), ["engine"]),
        ("plugin/test_report.py", ("pytester",), ["engine"]),
        ("plugin/test_fuzz.py", (), []),
        ("measure/test_gate.py", ("tmp_path",), []),
    ],
)
def test_what_asks_an_engine_is_marked(
    file: str, fixtures: tuple[str, ...], expected: list[str]
) -> None:
    assert marks(file, *fixtures) == expected


def test_a_test_of_numbers_is_in_it(request: pytest.FixtureRequest) -> None:
    assert request.node.get_closest_marker("engine") is None


def test_ci_runs_it_on_each_python_and_pytest_with_no_simulator() -> None:
    unit = CI["jobs"]["unit"]
    assert unit["strategy"]["matrix"] == {
        "python": ["3.11", "3.12", "3.13"],
        "pytest": ["8", "9"],
    }
    commands = [step["run"] for step in unit["steps"] if "run" in step]
    assert f'pytest tests -m "{conftest.QUICK}" -n 2' in commands
    assert [command for command in commands if "[all" in command] == []


def test_ci_runs_everything_but_what_two_engines_compile_long_for() -> None:
    commands = [step.get("run", "") for step in CI["jobs"]["engines"]["steps"]]
    assert [command for command in commands if "bash .ci/run" in command]
    assert 'pytest tests -n 2 --dist loadgroup -m "not costly"\n' in (ROOT / ".ci/run").read_text()
    for engine, left_out in (("genesis", ["costly"]), ("newton", ["costly"]), ("drake", [])):
        assert marks("tasks/test_it.py", name=f"test_it[{engine}-tuned-ball_rolls]") == left_out
        assert marks("tasks/test_it.py", name=f"test_it[{engine}-tuned-free_fall]") == []
    assert marks("tasks/test_it.py", "genesis", name="test_two_cubes_are_stacked") == ["costly"]
    assert "costly" in marks("sims/test_genesis.py", name="test_the_worker_survives_a_bad_option")


def test_what_is_slow_is_left_out_and_its_names_are_those_of_tests() -> None:
    sources = [path.read_text("utf-8") for path in (ROOT / "tests").glob("*/test_*.py")]
    gone = [name for name in conftest.SLOW if not any(f"def {name}(" in s for s in sources)]
    gone += [name for name in conftest.COSTLY if not any(f"def {name}(" in s for s in sources)]
    assert set(gone) <= CHECKS.keys()
    left = [SimpleNamespace(name="test_fine", originalname="test_fine")]
    slow = SimpleNamespace(name="test_error_rates[0.0]", originalname="test_error_rates")
    items: Any = [*left, slow]
    told: list[Any] = []
    hook = SimpleNamespace(pytest_deselected=lambda items: told.extend(items))
    config: Any = SimpleNamespace(getoption=lambda name: conftest.QUICK, hook=hook)
    conftest.pytest_collection_modifyitems(config, items)
    assert (items, told) == (left, [slow])
