"""The machine, as far as it bears on times."""

from __future__ import annotations

import os
import platform
from functools import cache
from pathlib import Path
from typing import Any


@cache
def host() -> dict[str, Any]:
    """System, processor and number of cores, for records."""
    model = platform.processor() or platform.machine()
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                model = line.partition(":")[2].strip()
                break
    except OSError:
        pass
    return {"system": platform.system(), "cpu": model, "cores": os.cpu_count() or 0}
