"""What GitHub shows besides: the summary page of a job, whose file takes Markdown, and a badge of a
README, the JSON that shields.io reads (shields.io/badges/endpoint-badge)."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path

from pytest_simbench.ground.text import in_one_line
from pytest_simbench.records.claims import Claim
from pytest_simbench.records.record import Record

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


LONGEST = 60
"""Characters of the message."""


def badge(records: Sequence[Record], passed: bool | None, claims: Sequence[Claim]) -> str:
    """The badge of a run, as JSON.

    Green: every test passed and no repetition crashed. Yellow: some did, or a claim is known to
    fail.
    Red: a test or a limit failed. Grey: nothing was measured, or it is not known what passed.
    Interrupted repetitions say nothing.
    """
    ended = [record for record in records if record.status != "interrupted"]
    failed = sum(not record.ok for record in ended)
    names = list(dict.fromkeys(record.simulator for record in ended))
    who = names[0] if len(names) == 1 else f"{len(names)} simulators"
    last = {claim.identity: claim for claim in claims if claim.metric}
    verdicts = [claim.verdict for claim in last.values() if claim.verdict]
    if not ended:
        message, colour = "nothing measured", "lightgrey"
    elif passed is None:
        message, colour = f"{who}: {len(ended)} repetitions, not judged", "lightgrey"
    elif not passed:
        message, colour = f"{who}: failing", "red"
    elif failed:
        message, colour = f"{who}: {failed} of {len(ended)} repetitions crashed", "yellow"
    elif known := verdicts.count("XFAIL"):
        message, colour = f"{who}: {known} of {len(verdicts)} claims known to fail", "yellow"
    else:
        message, colour = f"{who}: {len(ended)} repetitions passed", "brightgreen"
    data = {
        "schemaVersion": 1,
        "label": "simulators",
        "message": in_one_line(message, LONGEST),
        "color": colour,
    }
    return json.dumps(data) + "\n"
