"""What the installed plugin costs a pytest run that has nothing to do with it.

    python benchmarks/plugin_import.py [PAIRS]

Bound: under 20 ms. Runs of one empty test, with the plugin and without it in turn.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common import arguments, spread

OTHERS = ("xdist", "xdist.looponfail", "benchmark", "hypothesispytest")


def seconds(folder: Path, *more: str) -> float:
    """Wall seconds of a run of one empty test, with no other plugin and none of `more`."""
    off = [part for name in (*OTHERS, *more) for part in ("-p", f"no:{name}")]
    began = time.perf_counter()
    command = [sys.executable, "-m", "pytest", "-q", *off, str(folder)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - began


if __name__ == "__main__":
    number = arguments(__doc__, {"pairs": 15}).pairs
    with tempfile.TemporaryDirectory() as name:
        Path(name, "test_empty.py").write_text("def test_empty():\n    pass\n")
        pairs = [(seconds(Path(name)), seconds(Path(name), "simbench")) for _ in range(number)]
    print("plugin, ms:", spread([1000 * (own - without) for own, without in pairs], ".1f"))
    print("a run without it, ms:", spread([1000 * without for _, without in pairs], ".0f"))
