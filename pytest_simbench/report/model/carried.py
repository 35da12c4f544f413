"""What was carried of users' files, for the page."""

from __future__ import annotations

from pathlib import Path

from pytest_simbench.description.carried import STATES, kept
from pytest_simbench.report.model.document import Column, Section, Table


def sections(folder: Path) -> list[Section]:
    """One for each file that a run read; what is not carried first."""
    found = []
    for title, account in kept(folder).items():
        rows = sorted(account, key=lambda line: -STATES.index(line.state))
        columns = [
            Column("quantity", [line.quantity for line in rows], left=True, wrap=True),
            Column("state", [line.state for line in rows], left=True),
            Column("how, or why not", [line.reason for line in rows], left=True, wrap=True),
            Column("where", [line.where for line in rows], left=True, wrap=True),
        ]
        found.append(Section(f"What was carried of {title}", tables=[Table("", columns)]))
    return found
