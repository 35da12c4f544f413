"""CPU time of a worker's helpers: they count while they live, and after."""

from __future__ import annotations

import subprocess
import sys

import pytest

from pytest_simbench.worker.family import Family

BURN = "import time\nwhile time.process_time() < 0.3: pass\nprint(flush=True)\ninput()"
PARENT = f"import subprocess, sys\nsubprocess.run([sys.executable, '-c', {BURN!r}])"


@pytest.mark.skipif(sys.platform != "linux", reason="Linux alone tells who they are")
@pytest.mark.parametrize("helper", [BURN, PARENT], ids=["child", "child of a child"])
def test_a_helper_counts_while_it_lives_and_once_it_has_ended(helper: str) -> None:
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    family = Family()
    before = family.cpu()
    with subprocess.Popen([sys.executable, "-c", helper], **pipes) as child:
        assert child.stdout is not None
        child.stdout.readline()
        family.meet()
        living = family.cpu() - before
        child.communicate(b"\n")
    assert 0.3 <= living <= family.cpu() - before < 2 * living
