"""The summary page of a GitHub job: what its file takes is shown as Markdown."""

from __future__ import annotations

import os
from pathlib import Path

VARIABLE = "GITHUB_STEP_SUMMARY"
"""Names the file (docs.github.com, workflow commands, adding a job summary)."""

LARGEST = 1024 * 1024
"""A step's summary may have 1 MiB; of a larger one GitHub shows nothing."""


def append_summary(text: str) -> str:
    """Append Markdown to the job's summary, where there is one.

    Returns:
        A sentence when it could not be written, else nothing.
    """
    name = os.environ.get(VARIABLE)
    if not name:
        return ""
    path = Path(name)
    try:
        used = path.stat().st_size if path.exists() else 0
        data = text.encode()
        if used + len(data) > LARGEST:
            return f"the summary for GitHub would be larger than {LARGEST} bytes and is left out"
        with path.open("ab") as file:
            file.write(data + b"\n")
    except OSError as error:
        return f"the summary for GitHub cannot be written to {path} ({error.strerror})"
    return ""
