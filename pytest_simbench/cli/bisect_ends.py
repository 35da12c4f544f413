"""`simbench bisect NAME:GOOD..BAD ends --sim-scene FILE`: the first release in which a scene's
bodies end elsewhere, and whether that release is the cause of it."""

from __future__ import annotations

import math
from itertools import pairwise

from pytest_simbench.cli.search import Search
from pytest_simbench.cli.values import BadInput
from pytest_simbench.measure.bisection import first_worse
from pytest_simbench.measure.settling import ALIKE, Settled, settlings
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.series import Configured
from pytest_simbench.report.model.settling import sentences


def bisect_ends(search: Search) -> int:
    """Find it, say so, and return the exit code: 1 where the good and the bad release end alike, or
    where the scene's own noise explains the difference.

    Raises:
        BadInput: the tests leave no scene to itself, or a run ends with an error.
    """
    releases, last = search.releases, len(search.releases) - 1
    search.run(0, last)
    settled, ends = _ends(search, 0, last)
    gap = settled.apart(*(settled.written[who] for who in ends))[0]
    if gap <= ALIKE:
        print(f"{releases[0]} and {releases[last]} end alike, within {ALIKE:g} mm")
        return 1

    def is_worse(place: int) -> bool:
        search.run(place)
        settled, ends = _ends(search, 0, place, last)
        good, here, bad = (settled.written[who] for who in ends)
        to_good, to_bad = settled.apart(good, here)[0], settled.apart(here, bad)[0]
        as_bad = to_bad < to_good
        print(
            f"{releases[place]} ends {to_good:.2g} mm from {releases[0]} and {to_bad:.2g} mm from "
            f"{releases[last]}: {'worse' if as_bad else 'good'}",
            flush=True,
        )
        return as_bad

    place = first_worse(len(releases), is_worse)
    print(f"the first release that ends elsewhere is {releases[place]}")
    settled, ends = _ends(search, place - 1, place)
    print(*sentences(settled.only(ends)), sep="\n")
    print(f"results: {search.folder}")
    if settled.tried(*ends) is not None and settled.explained(*ends) is None:
        return 0
    print(f"so {releases[place]} is not shown to be the cause")
    return 1


def _ends(search: Search, *places: int) -> tuple[Settled, list[Configured]]:
    """The scene, and some releases that have run, as it names them.

    Raises:
        BadInput: no test, or several, left a scene to itself in them, or from no start in common.
    """
    names = [search.named(place) for place in places]
    found = settlings(RunFolder(search.folder).read().records)
    if len(found) != 1:
        raise BadInput(
            f"{len(found) or 'no'} scenes were left to themselves on {' and '.join(names)}; choose "
            "one, with --sim-scene FILE"
        )
    (settled,) = found
    who = [one for name in names for one in settled.written if one[0] == name]
    if len(who) != len(places):
        raise BadInput(
            f"{' and '.join(names)} need one end of {settled.scene} each, and have {len(who)}; see "
            "what crashed, and choose one mode and profile"
        )
    gaps = [settled.apart(settled.written[a], settled.written[b])[0] for a, b in pairwise(who)]
    if any(map(math.isnan, gaps)):
        raise BadInput(f"no start ended in each of {' and '.join(names)}; see what crashed")
    return settled, who
