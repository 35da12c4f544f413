"""What the makers of tables share: how a table stands in its page, and what a record tells.

A table stands between `<!-- NAME: WORD WORD -->` and `<!-- end -->`: NAME is the maker's, and the
words say which table it is.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from pytest_simbench.records.record import Record


def filled(page: Path, name: str, table: Callable[..., str]) -> str:
    """The text of a page with its tables of that name made anew; `table` is called with the words
    of each."""
    return re.sub(
        rf"(<!-- {name}: (\w+(?: \w+)*) -->\n).*?(<!-- end -->)",
        lambda found: f"{found[1]}\n{table(*found[2].split())}\n{found[3]}",
        page.read_text("utf-8"),
        flags=re.DOTALL,
    )


def engine_version(record: Record) -> str:
    """Of the engine; empty where the record does not tell it."""
    other = ("python", "pytest-simbench")
    return next((v for k, v in record.versions.items() if k not in other), "")
