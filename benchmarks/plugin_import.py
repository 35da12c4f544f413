"""What the installed plugin costs a pytest run that has nothing to do with it.

python benchmarks/plugin_import.py
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

RUNS = 15
WITHOUT_OTHERS = [
    part
    for name in ("xdist", "xdist.looponfail", "benchmark", "hypothesispytest")
    for part in ("-p", f"no:{name}")
]


def seconds(folder: Path, *arguments: str) -> float:
    """Wall seconds of a run of one empty test."""
    began = time.perf_counter()
    command = [sys.executable, "-m", "pytest", "-q", *WITHOUT_OTHERS, *arguments, str(folder)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=os.environ)
    return time.perf_counter() - began


def main() -> None:
    folder = Path(tempfile.mkdtemp())
    (folder / "test_empty.py").write_text("def test_empty():\n    pass\n")
    pairs = [(seconds(folder), seconds(folder, "-p", "no:simbench")) for _ in range(RUNS)]
    cost = [1000 * (with_it - without) for with_it, without in pairs]
    print(
        f"plugin: {statistics.median(cost):.1f} ms (min {min(cost):.1f}, max {max(cost):.1f}, "
        f"{RUNS} pairs); a run without it takes "
        f"{1000 * statistics.median(without for _, without in pairs):.0f} ms"
    )


if __name__ == "__main__":
    main()
