"""What laws are grouped by (`laws`), for tables too."""

from __future__ import annotations

PHENOMENA = (
    "free motion",
    "impact",
    "sticking",
    "sliding",
    "rolling",
    "stacking",
    "grasping",
    "joints",
    "pushing",
)
"""In the order of tables; `joints` with their drives."""

PHENOMENON = "task.phenomenon"
"""Where a record's settings say that it is of a law, and of which phenomenon."""
