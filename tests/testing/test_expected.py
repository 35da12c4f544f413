"""Expected failures and the decorator, as a third party uses them."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_simbench.simulator.registry import UnknownSimulatorError
from pytest_simbench.testing import CHECKS, ConformanceWarning, conformance_checks
from pytest_simbench.testing.kit import read_expected_failures, reason_for, unmatched


def test_file_of_expected_failures(tmp_path: Path) -> None:
    path = tmp_path / "expected.txt"
    path.write_text("# why\n\nfree_fall: air\nmysim-tuned-tower*: soft: very\n")
    reasons = read_expected_failures(path)
    assert reasons == {"free_fall": "air", "mysim-tuned-tower*": "soft: very"}
    assert reason_for("mysim-default-free_fall", reasons) == "air"
    assert reason_for("mysim-tuned-tower_stands", reasons) == "soft: very"
    assert reason_for("mysim-default-tower_stands", reasons) is None
    assert unmatched(reasons, ["mysim-default-free_fall"]) == ["mysim-tuned-tower*"]


@pytest.mark.parametrize("line", ["free_fall", "free_fall:  "])
def test_line_without_reason_is_an_error(tmp_path: Path, line: str) -> None:
    path = tmp_path / "expected.txt"
    path.write_text(f"# first\n{line}\n")
    with pytest.raises(ValueError, match=r"expected.txt, line 2: write"):
        read_expected_failures(path)


def test_line_that_matches_nothing_warns() -> None:
    with pytest.warns(ConformanceWarning, match="'free_fal' matches no check; there are"):
        conformance_checks("mujoco", expected_failures={"free_fal": "typing error"})


def test_unknown_names_list_the_known() -> None:
    with pytest.raises(ValueError, match="no checks named .*choose from .*free_fall"):
        conformance_checks("mujoco", only=["free_fal"])
    with pytest.raises(UnknownSimulatorError, match="mujoco"):
        conformance_checks("mujocco")


def test_every_check_states_its_law() -> None:
    assert [check.name for check in CHECKS.values() if len(check.doc) < 40] == []


def test_third_partys_test_file(pytester: pytest.Pytester) -> None:
    """Readable ids; expected failure, passing expected failure, missing capability, failure."""
    pytester.makepyfile(
        mysim="""
from dataclasses import replace
from pytest_simbench.sims.mujoco.adapter import MuJoCo
from pytest_simbench.simulator import Capability

class MySim(MuJoCo):
    info = replace(
        MuJoCo.info, name="mysim", capabilities=frozenset({Capability.SAVE_RESTORE})
    )

    def restore(self, state):
        pass
""",
        test_mysim="""
from mysim import MySim
from pytest_simbench.testing import conformance_checks

@conformance_checks(
    MySim,
    only=["restore_repeats", "free_fall", "contacts_counted", "restore_in_the_grip"],
    expected_failures={"restore_repeats": "known", "mysim-tuned-free_fall": "no more"},
)
def test_conformance(check):
    check()
""",
    )
    result = pytester.runpytest_subprocess("-v", "-rA")
    result.stdout.fnmatch_lines_random(
        [
            "XFAIL *test_conformance?mysim-tuned-restore_repeats? - known (*",
            "PASSED *test_conformance?mysim-tuned-free_fall?",
            "SKIPPED *mysim does not claim contact_count",
            "FAILED *test_conformance?mysim-tuned-restore_in_the_grip?*",
            "*ConformanceWarning: mysim-tuned-free_fall is listed as an expected failure*",
        ]
    )
    result.assert_outcomes(passed=1, failed=1, skipped=1, xfailed=1, warnings=1)


def test_missing_engine_is_skipped(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
from dataclasses import replace
from pytest_simbench.sims.mujoco.adapter import MuJoCo
from pytest_simbench.testing import conformance_checks

class Gone(MuJoCo):
    info = replace(MuJoCo.info, name="gone", modules=("no_such_engine",), install="buy it")

@conformance_checks(Gone, only=["free_fall"])
def test_conformance(check):
    check()
"""
    )
    result = pytester.runpytest_subprocess("-rs")
    result.stdout.fnmatch_lines(
        ["*gone is not installed (no module no_such_engine); install it: buy it*"]
    )
    result.assert_outcomes(skipped=1)
