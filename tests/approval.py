"""Long texts, word for word: what somebody read and approved lies in `approved/`.

Who changes one on purpose writes them anew, and reads what changed:

    SIMBENCH_APPROVE=1 pytest tests/report/test_whole.py; git diff tests/approved
"""

from __future__ import annotations

import os
import re
from pathlib import Path

APPROVED = Path(__file__).parent / "approved"

LONG = re.compile(r"\d+\.\d{7,}(e-?\d+)?")
"""Numbers whose last digits another processor may round otherwise."""


def assert_approved(name: str, text: str) -> None:
    """The text is that of the file, but for the last digits of long numbers."""
    found = LONG.sub(lambda number: f"{float(number[0]):.6g}", text)
    file = APPROVED / f"{name}.txt"
    if os.environ.get("SIMBENCH_APPROVE"):
        file.write_text(found)
    assert found == file.read_text()


def assert_approved_line(name: str, key: str, text: str) -> None:
    """The same of one line of a file, `key: text`, of several that tests share."""
    file = APPROVED / f"{name}.txt"
    lines = file.read_text().splitlines() if file.exists() else []
    if os.environ.get("SIMBENCH_APPROVE"):
        lines = sorted(
            [*(line for line in lines if not line.startswith(f"{key}: ")), f"{key}: {text}"]
        )
        file.write_text("\n".join([*lines, ""]))
    assert f"{key}: {text}" in lines
