"""`simbench bisect NAME:GOOD..BAD ends --sim-scene FILE`: the first release in which a scene's
bodies end elsewhere, and whether that release is the cause of it."""

from __future__ import annotations

from dataclasses import dataclass

from pytest_simbench.cli.search import Search
from pytest_simbench.cli.values import BadInput
from pytest_simbench.measure.bisection import first_worse
from pytest_simbench.measure.settling import ALIKE, Settled, Who, settlings
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.report.model.settling import sentences


def bisect_ends(search: Search) -> int:
    """Find it, say so, and return the exit code: 1 where the good and the bad release end alike, or
    where the scene's own noise explains the difference.

    Raises:
        BadInput: the tests leave no scene to itself, or a run ends with an error.
    """
    last = len(search.releases) - 1
    search.run(0, last)
    ends = _Ends(search)
    gap = ends.apart(0, last)
    if gap <= ALIKE:
        print(f"{search.releases[0]} and {search.releases[last]} end alike, within {ALIKE:g} mm")
        return 1

    def is_worse(place: int) -> bool:
        search.run(place)
        to_good, to_bad = ends.apart(0, place), ends.apart(last, place)
        as_bad = to_bad < to_good
        print(
            f"{search.releases[place]} ends {to_good:.2g} mm from {search.releases[0]} and "
            f"{to_bad:.2g} mm from {search.releases[last]}: {'worse' if as_bad else 'good'}",
            flush=True,
        )
        return as_bad

    place = first_worse(len(search.releases), is_worse)
    print(f"the first release that ends elsewhere is {search.releases[place]}")
    settled, (before, after) = ends.of(place - 1, place)
    print(*sentences(settled.only([before, after])), sep="\n")
    print(f"results: {search.folder}")
    unexplained = bool(settled.moved) and settled.explained(before, after) is None
    if not unexplained:
        print(f"so {search.releases[place]} is not shown to be the cause")
    return 0 if unexplained else 1


@dataclass(frozen=True)
class _Ends:
    """Where the bodies end in the releases that have run."""

    search: Search

    def of(self, *places: int) -> tuple[Settled, list[Who]]:
        """The scene, and some releases as it names them.

        Raises:
            BadInput: no test, or several, left a scene to itself in them.
        """
        names = [self.search.named(place) for place in places]
        found = settlings(RunFolder(self.search.folder).read().records)
        if len(found) != 1:
            raise BadInput(
                f"{len(found) or 'no'} scenes were left to themselves on {' and '.join(names)}; "
                "choose one, with --sim-scene FILE"
            )
        (settled,) = found
        who = [one for name in names for one in settled.written if one[0] == name]
        if len(who) != len(places):
            raise BadInput(
                f"{' and '.join(names)} need one end of {settled.scene} each, and have {len(who)}; "
                "see what crashed, and choose one mode and profile"
            )
        return settled, who

    def apart(self, a: int, b: int) -> float:
        """How far apart two releases end as the scene is written [mm]."""
        settled, who = self.of(a, b)
        return settled.apart(*(settled.written[one] for one in who))[0]
