"""Is the plugin at peace with others? It is installed, not from its sources, beside each of them.

    python tests/matrix.py              the newest pytest with all the others: what CI runs
    python tests/matrix.py --all        pytest 8 and 9, with and without each of them
    python tests/matrix.py --folder F   keep the environments in F, to run again in seconds

First the wheel and the sdist are built and looked at. Then each environment is made with venv and
pip (with uv, where it is on the PATH), and what a user types first is run there. Ends with exit
status 1 when something is not as it should be.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from pytest_simbench.laws import LAWS
from pytest_simbench.plugin.options import OPTIONS

HERE = Path(__file__).resolve().parent.parent

PLUGINS = ("xdist", "rerunfailures", "randomly", "timeout", "asyncio", "playwright", "seleniumbase")
"""pytest-NAME each, but for the last. Playwright and SeleniumBase do not go together: both want
`--headed`."""

WANT_OUR_NAMES = {"seleniumbase": {"--gui", "--headless", "--protocol"}}
"""Of our short names, those that a plugin has for itself."""


@dataclass(frozen=True)
class Place:
    """An environment.

    Attributes:
        pytest: its major version.
        plugins: of `PLUGINS`.
    """

    pytest: int
    plugins: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return "-".join((f"pytest{self.pytest}", *self.plugins))

    @property
    def requirements(self) -> list[str]:
        packages = [p if p == "seleniumbase" else f"pytest-{p}" for p in self.plugins]
        # Its older releases pin no pytest, and pip would dig them out.
        packages = [p.replace("seleniumbase", "seleniumbase>=4.40") for p in packages]
        return [f"pytest>={self.pytest},<{self.pytest + 1}", *packages]


ALL = tuple(p for p in PLUGINS if p != "seleniumbase")
QUICK = (Place(9), Place(9, ALL), Place(9, ("seleniumbase",)))
EVERY = tuple(
    Place(pytest, plugins)
    for pytest in (8, 9)
    for plugins in ((), *((plugin,) for plugin in PLUGINS), ALL)
)


def build(source: Path, folder: Path) -> Path:
    """The wheel, made from the sdist.

    Raises:
        SystemExit: sdist or wheel are not as they should be.
    """
    for kind, arguments in (("sdist", ()), ("tree", ("--wheel",))):
        command = [sys.executable, "-m", "build", "--outdir", str(folder / kind), *arguments]
        quiet = subprocess.DEVNULL  # the build's own warnings
        subprocess.run([*command, str(source)], check=True, stdout=quiet, stderr=quiet)
    files = sorted(map(str, (folder / "sdist").iterdir()))
    subprocess.run([sys.executable, "-m", "twine", "check", "--strict", *files], check=True)
    wheel, other = (next((folder / kind).glob("*.whl")) for kind in ("sdist", "tree"))
    problem = wrong_content(contents(wheel), contents(other), source)
    if problem:
        sys.exit(problem)
    return wheel


def contents(wheel: Path) -> dict[str, bytes]:
    """The files of a wheel."""
    with zipfile.ZipFile(wheel) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def wrong_content(wheel: dict[str, bytes], other: dict[str, bytes], source: Path) -> str:
    """What is wrong with the wheel of the sdist: against that of the tree, and the tree itself."""
    package = "pytest_simbench"
    wanted: set[str] = set()
    for folder, inside in (
        (package, package),
        *((n, f"{package}/{n}") for n in ("sims", "suites")),
    ):
        tree = source / folder
        files = (p for p in tree.rglob("*") if p.is_file() and p.parent.name != "__pycache__")
        wanted |= {f"{inside}/{path.relative_to(tree)}" for path in files}
    found = {name for name in wheel if ".dist-info/" not in name}
    if found != wanted:
        return f"missing in the wheel: {wanted - found}; too much: {found - wanted}"
    if wheel != other:
        return "the sdist and the tree build two different wheels"
    return ""


def make(place: Place, wheel: Path, folder: Path) -> Path:
    """The environment's interpreter; what is there already is brought up to date."""
    python = folder / place.name / "bin" / "python"
    wanted = [*place.requirements, f"{wheel}[mujoco]"]
    uv = shutil.which("uv")
    if not python.exists():
        command = [uv, "venv", "-q"] if uv else [sys.executable, "-m", "venv"]
        subprocess.run([*command, str(folder / place.name)], check=True)
    pip = [uv, "pip", "install", "-q", "--python", str(python)] if uv else [
        str(python), "-m", "pip", "install", "-q"]  # fmt: skip
    subprocess.run([*pip, *wanted], check=True)
    again = "--reinstall-package=pytest-simbench" if uv else "--force-reinstall"
    subprocess.run([*pip, again, "--no-deps", str(wheel)], check=True)
    return python


OWN_TEST = """
def test_own(tmp_path):
    assert tmp_path.is_dir()
"""

WITH_OPTIONS = """
def pytest_addoption(parser):
    parser.addoption("--gui", action="store_true", help="the project's own")
    parser.addoption("--reps", help="the project's own")
    parser.addini("jitter", "the project's own", type="bool", default=False)
"""

RERUN = """
import pytest

attempts = []

@pytest.mark.flaky(reruns=1)
def test_again(repeat):
    from pytest_simbench.tasks import Throwing
    repeat(Throwing())
    attempts.append(1)
    assert len(attempts) == 2
"""


@dataclass(frozen=True)
class Step:
    """A command and what must come of it.

    Attributes:
        arguments: of pytest.
        shows: regular expressions, each of which the output must match.
        files: of the project that it runs in.
    """

    arguments: tuple[str, ...]
    shows: tuple[str, ...] = ()
    files: tuple[tuple[str, str], ...] = (("test_own.py", OWN_TEST),)


def steps(place: Place) -> Iterator[Step]:
    """What is run in an environment."""
    others = set().union(*(WANT_OUR_NAMES.get(plugin, set()) for plugin in place.plugins))
    short = [option for option in OPTIONS if option.long]
    names = [option.long if option.flag in others else option.flag for option in short]
    own = [rf"(?m)^  {flag}[ =]" for flag in (*names, "--sim-compare-fail")]
    yield Step(("--help",), ("placed:5%,ram:10%,rtf:20%", *own))
    yield Step(("--sims",), (r"mujoco: MuJoCo", *(f"{f} belongs to another" for f in others)))
    yield Step(("--markers",), ("only_sim",))
    yield Step(("--fixtures",), ("simulator", *(("output_path",))))
    yield Step((), ("1 passed",))
    yield Step(("-p", "no:benchmark", "--strict-markers"), ("1 passed",))
    suites = ("test_throwing.py", "test_stacking.py")[: 2 if place.plugins in ((), ALL) else 1]
    smallest = ("--sim=mujoco", "--sim-protocol=smoke", "--sim-output=out")
    files = tuple((name, (HERE / "suites" / name).read_text("utf-8")) for name in suites)
    shown = (f"{len(suites)} passed", "simulator comparison")
    yield Step((*suites, *smallest), shown, files)
    if not place.plugins:
        every = f"{8 + len(LAWS)} passed, "  # what is skipped has no measured data or no file
        yield Step(("--pyargs", "pytest_simbench.suites", *smallest), (every, shown[1]))
    if place.plugins in ((), ALL):
        without = ("-p", "no:benchmark", "--strict-markers")
        yield Step((suites[0], *smallest, *without), ("1 passed",), files)
    taken = (("test_own.py", OWN_TEST), ("conftest.py", WITH_OPTIONS))
    if "--gui" not in others:  # two others that want one name are no matter of ours
        theirs = [rf"(?m)^  {flag}[ =]" for flag in ("--sim-gui", "--sim-reps")]
        yield Step(("--help",), ("the project's own", *theirs), taken)
        yield Step(("--gui", "--reps", "x"), ("1 passed",), taken)
    if "xdist" in place.plugins:
        yield Step((*suites, *smallest, "-n2"), shown, files)
    if {"rerunfailures", "seleniumbase"} & set(place.plugins):
        once = ("1 passed, 1 rerun", "benchmark 'test_again': 1 tests")
        table = "--benchmark-columns=min"  # the table is there where one of its options is
        yield Step(("test_again.py", *smallest, table), once, (("test_again.py", RERUN),))


def check(python: Path, step: Step) -> str:
    """Run a command in a project of its own; what is wrong with it, or nothing."""
    with tempfile.TemporaryDirectory() as folder:
        for name, text in step.files:
            Path(folder, name).write_text(text, "utf-8")
        variables = {
            k: v
            for k, v in os.environ.items()
            if not k.startswith(("PYTEST", "PYTHON", "SIMBENCH_DATA"))
        }
        result = subprocess.run(
            [str(python), "-m", "pytest", *step.arguments], cwd=folder, env=variables,
            capture_output=True, text=True, check=False, timeout=600,
        )  # fmt: skip
    text = result.stdout + result.stderr
    wrong = [f"it shows no {pattern!r}" for pattern in step.shows if not re.search(pattern, text)]
    if result.returncode:
        wrong.append(f"exit status {result.returncode}")
    if "Traceback (" in text or "INTERNALERROR" in text:
        wrong.append("a traceback")
    return "" if not wrong else f"{'; '.join(wrong)}\n{text[-3000:]}"


def failures(place: Place, wheel: Path, folder: Path) -> int:
    """How many commands did not do in an environment what they should; each is told."""
    python, failed = make(place, wheel, folder), 0
    for step in steps(place):
        problem = check(python, step)
        failed += bool(problem)
        command = " ".join(("pytest", *step.arguments))
        print(f"{place.name}: {command}: {problem or 'ok'}", flush=True)
    return failed


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("--all", action="store_true", help="every environment, not only the newest")
    parser.add_argument("--folder", type=Path, help="keeps the environments")
    parser.add_argument("--only", help="just the environment of this name")
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as temporary:
        folder = (given.folder or Path(temporary)).absolute()
        built, copy = Path(temporary, "built"), Path(temporary, "source")
        # an old build would stay in; and what runs beside this compiles files meanwhile
        hidden = shutil.ignore_patterns(".*", "build", "*.egg-info", "__pycache__")
        shutil.copytree(HERE, copy, ignore=hidden)
        wheel = build(copy, built)
        known = EVERY if given.all or given.only else QUICK
        places = [place for place in known if given.only in (None, place.name)]
        with ThreadPoolExecutor(2) as both:  # half of the time goes into downloads
            failed = sum(both.map(lambda place: failures(place, wheel, folder), places))
    print(f"{failed} commands failed" if failed else "all commands did what they should")
    return min(failed, 1)


if __name__ == "__main__":
    sys.exit(main())
