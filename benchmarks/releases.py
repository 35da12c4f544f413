"""Do the adapters run with the releases that they say they run with? One line a release.

    python benchmarks/releases.py mujoco:12:minor drake==1.30.0 > docs/data/releases.csv

Runs the conformance kit on each release, in an environment of its own that is made where it is not
there: `NAME:N` the last N releases, `:minor` the last of each minor version, `NAME==VERSION` one.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path
from xml.etree import ElementTree

from pytest_simbench.client.environments import Environment
from pytest_simbench.client.package_index import newest_of_minors, releases
from pytest_simbench.simulator.errors import SimulatorError
from pytest_simbench.simulator.registry import adapter

TEST = """
from pytest_simbench.testing import conformance_checks

@conformance_checks({name!r})
def test_conformance(check):
    check()
"""


def named(text: str) -> list[str]:
    """The simulators that an argument means."""
    name, _, rest = text.partition(":")
    if not rest:
        return [name]
    number, _, minor = rest.partition(":")
    found = releases(adapter(name).info.distribution)
    found = newest_of_minors(found) if minor else found
    return [f"{name}=={version}" for version in found[-int(number) :]]


def line(name: str) -> str:
    """Simulator, release, laws passed and failed, and which failed."""
    try:
        environment = Environment.of(adapter(name).info)
        if environment.problem:
            environment.create()
    except SimulatorError as error:
        return f'{name},,,"{" ".join(str(error).split())[:200]}"'
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "test_kit.py").write_text(TEST.format(name=name))
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
        subprocess.run(
            [*command, "--junitxml=kit.xml", "test_kit.py"],
            cwd=folder, stdout=subprocess.DEVNULL, check=False,
        )  # fmt: skip
        cases = list(ElementTree.parse(Path(folder, "kit.xml")).iter("testcase"))
    failed = [case for case in cases if case.find("failure") is not None]
    skipped = [case for case in cases if case.find("skipped") is not None]
    laws = " ".join(re.sub(r".*-tuned-(\w+).*", r"\1", case.get("name", "")) for case in failed)
    for case in failed:
        problem = case.find("failure")
        print(name, problem.get("message", "")[:300] if problem is not None else "",
              file=sys.stderr)  # fmt: skip
    return f"{name},{len(cases) - len(failed) - len(skipped)},{len(failed)},{laws}"


if __name__ == "__main__":
    print("release,passed,failed,laws")
    for simulator in [name for text in sys.argv[1:] for name in named(text)]:
        print(line(simulator), flush=True)
