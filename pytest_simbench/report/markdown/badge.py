"""A badge for a README: the JSON that shields.io reads (shields.io/badges/endpoint-badge)."""

from __future__ import annotations

import json
from collections.abc import Sequence

from pytest_simbench.ground.text import in_one_line
from pytest_simbench.records.record import Record

LABEL = "simulators"

LONGEST = 60
"""Characters of the message."""


def badge(records: Sequence[Record], passed: bool | None) -> str:
    """The badge of a run, as JSON.

    Green: every test passed and no repetition crashed. Yellow: the tests passed although some did.
    Red: a test or a limit failed. Grey: nothing was measured, or it is not known what passed.
    Interrupted repetitions say nothing.
    """
    ended = [record for record in records if record.status != "interrupted"]
    failed = sum(not record.ok for record in ended)
    names = list(dict.fromkeys(record.simulator for record in ended))
    who = names[0] if len(names) == 1 else f"{len(names)} simulators"
    if not ended:
        message, colour = "nothing measured", "lightgrey"
    elif passed is None:
        message, colour = f"{who}: {len(ended)} repetitions, not judged", "lightgrey"
    elif not passed:
        message, colour = f"{who}: failing", "red"
    elif failed:
        message, colour = f"{who}: {failed} of {len(ended)} repetitions crashed", "yellow"
    else:
        message, colour = f"{who}: {len(ended)} repetitions passed", "brightgreen"
    data = {
        "schemaVersion": 1,
        "label": LABEL,
        "message": in_one_line(message, LONGEST),
        "color": colour,
    }
    return json.dumps(data) + "\n"
