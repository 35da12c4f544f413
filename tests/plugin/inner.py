"""What the tests of inner pytest runs share: a small test file, and what is looked at after."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

FALLING = """
from tests.tiny import Falling

def test_falling(repeat):
    repeat(Falling())
"""

CLAIMING = FALLING.rstrip() + '.assert_at_least("landed", 0.1)\n'


def records(folder: Path | str) -> list[dict[str, Any]]:
    """The records of a run folder."""
    return [json.loads(line) for line in Path(folder, "records.jsonl").read_text().splitlines()]


def no_traceback(result: pytest.RunResult) -> None:
    """Complain of a traceback, also of one inside pytest."""
    text = result.stdout.str() + result.stderr.str()
    assert "Traceback (" not in text
    assert "INTERNALERROR" not in text
