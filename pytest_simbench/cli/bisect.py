"""`simbench bisect NAME:GOOD..BAD METRIC`: the first release in which a metric is worse.

Each step is a pytest run of its own, with the same tests and options, on one more release. All of
them lie in one folder, that of `--sim-history` with the same settings: what is recorded there is
not run again.

Which folder that is depends on all options, and on the ini file. So the command starts pytest,
whose plugin knows them and calls `bisect`.

With `ends` in place of a metric it is about a user's scene (bisect_ends.py).
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from pytest_simbench.cli.bisect_ends import bisect_ends
from pytest_simbench.cli.search import Search
from pytest_simbench.cli.values import BadInput, Span
from pytest_simbench.client import package_index
from pytest_simbench.measure.bisection import between, first_worse, like_the_bad_one, steps
from pytest_simbench.measure.comparison import MeanDifference
from pytest_simbench.measure.speed import compared
from pytest_simbench.simulator.registry import adapter

ENDS = "ends"
"""In place of a metric: where the bodies of a scene end."""


def bisect(wanted: Span, metric_name: str, folder: Path, arguments: Sequence[str]) -> int:
    """Find it, say so, and return the exit code: 1 where the bad release is not worse. See `Search`
    for the arguments.

    Raises:
        BadInput: no such simulator, release or metric; a run that ends with an error.
        SimulatorError: no such simulator, or no package index answers.
    """
    releases = _releases(wanted)
    search = Search(wanted.name, metric_name, releases, folder, arguments)
    last = len(releases) - 1
    print(
        f"bisecting {len(releases)} releases of {wanted.name}: {steps(len(releases))} steps, and "
        "the ends"
    )
    if metric_name == ENDS:
        return bisect_ends(search)
    search.run(0, last)
    metric = search.metric()
    good, bad = search.result(0), search.result(last)
    for end, place in ((good, 0), (bad, last)):
        if not end.values(metric):
            raise BadInput(f"{search.describe(place)}, so nothing tells worse")
    found, _ = compared(metric, good, bad)
    if not (found.significant() and metric.differs(found.first, found.second)):
        tiny = "by less than means anything" if found.significant() else _sure(found)
        more = "" if found.sole else "; try more of them, --reps 40 for instance"
        print(
            f"{search.describe(0)}, {search.describe(last)}: these repetitions do not show that it "
            f"is worse ({tiny}), so there is nothing to find{more}"
        )
        return 1

    def is_worse(place: int) -> bool:
        search.run(place)
        worse = like_the_bad_one(metric, good, bad, search.result(place))
        print(f"{search.describe(place)}: {'worse' if worse else 'good'}", flush=True)
        return worse

    place = first_worse(len(releases), is_worse)
    sides = search.result(place - 1), search.result(place)
    sure = ""
    if all(side.values(metric) for side in sides):
        step, _ = compared(metric, *sides)
        apart = "" if step.significant() else ", which does not tell the two apart"
        sure = f" ({_sure(step)}{apart})"
    print(
        f"the first worse release is {releases[place]}: {search.describe(place - 1)}, "
        f"{search.describe(place)}{sure}"
    )
    print(f"results: {search.folder}")
    return 0


def start(span: Span, metric: str, arguments: Sequence[str]) -> int:
    """Have the plugin of pytest call `bisect` for these tests and options; pytest's exit code.

    Raises:
        BadInput: a file of tests that is not there, told before releases are installed.
    """
    for path in (word.partition("::")[0] for word in arguments):
        if path.endswith(".py") and path[0] != "-" and not Path(path).exists():
            raise BadInput(f"there is no file {path}; name the file of the tests")
    releases = f"{span.name}:{span.good}..{span.bad}"
    own = [sys.modules[__name__]]  # tells the plugin who asks
    return int(pytest.main([*arguments, "--sim-bisect", releases, metric], plugins=own))


def _sure(found: MeanDifference) -> str:
    return "every repetition is the same" if found.sole else f"p = {found.p_value:.2g}"


def _releases(wanted: Span) -> list[str]:
    """The releases from the good one to the bad one.

    Raises:
        BadInput: no such simulator or release; one sentence.
    """
    info = adapter(wanted.name).info
    known = package_index.releases(info.distribution)
    for version in (wanted.good, wanted.bad):
        problem = package_index.unreleased(info.distribution, version, known)
        if problem or version not in known:
            raise BadInput(problem or f"write {version} in full")
        if refused := info.refused(version):
            raise BadInput(refused)
    return between(known, wanted.good, wanted.bad)
