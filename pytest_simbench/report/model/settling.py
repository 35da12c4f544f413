"""A user's scene in several simulators: do they differ, and by more than the scene's own noise?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations, groupby, pairwise

from pytest_simbench.ground.versions import RELEASE, VersionedName, release_numbers
from pytest_simbench.measure.settling import ALIKE, Ends, Settled
from pytest_simbench.records.metrics import significant
from pytest_simbench.records.series import Configured
from pytest_simbench.report.model import cells
from pytest_simbench.report.model.document import Column, Section, Table, listed, names

NAMED = 4
"""How many simulators of a group a sentence names."""

READING = (
    "Each number is how far a body ends from where it ends in the same simulator as the scene is "
    "written, in millimetres, of the body that ends farthest; before it the share of the premises "
    "that hold."
)


def section(found: Settled) -> Section:
    """The answer, and the numbers that it stands on."""
    table = Table("the scene's noise", _table(found), READING)
    return Section(f"Scene {found.scene}", sentences(found), [table])


def sentences(found: Settled) -> list[str]:
    """Which differ as the scene is written, whether a moved start explains it, and whether it
    survives a finer step."""
    known = dict(zip(found.written, names(list(found.written)), strict=True))
    releases = _releases(found)
    groups = found.places(found.written)
    if releases:
        groups = sorted(groups, key=lambda group: min(releases.index(who) for who in group))
    if len(groups) < 2:
        return [_alike(found, known), *_alone(found)]
    ways = "; ".join(_some(_spans(group, releases, known)) for group in groups)
    pairs = _between(found, found.written, groups)
    if not pairs:
        return [
            f"As written, {ways} have no start of {found.scene} in common that ended, so nobody "
            "knows whether they end alike.",
            _finer(found, known),
        ]
    widest = max(pairs, key=lambda pair: found.apart(*(found.written[who] for who in pair))[0])
    gap, body = found.apart(*(found.written[who] for who in widest))
    told = [
        f"As written, {found.scene} ends in {len(groups)} ways: {ways}. They differ by up to "
        f"{_mm(gap)} ({body}, {known[widest[0]]} and {known[widest[1]]})."
    ]
    if unknown := sum(len(a) * len(b) for a, b in combinations(groups, 2)) - len(pairs):
        told.append(f"Of {unknown} pairs more nobody knows, since no start ended in both.")
    return [*told, *_boundaries(found, releases), _noise(found, pairs), _finer(found, known)]


def _between(
    found: Settled, ends: Mapping[Configured, Ends], groups: Sequence[Sequence[Configured]]
) -> list[tuple[Configured, Configured]]:
    """Each two that are in different groups and have a start in common."""
    return [
        (a, b)
        for first, second in combinations(groups, 2)
        for a in first
        for b in second
        if found.apart(ends[a], ends[b])[0] > ALIKE
    ]


def _releases(found: Settled) -> list[Configured]:
    """Who is compared, oldest first, where all are releases of one simulator; else nobody."""
    named = [VersionedName.of(who[0]) for who in found.written]
    alone = len({name.base for name in named}) == len({who[1:] for who in found.written}) == 1
    if len(named) < 2 or not alone or {name.kind for name in named} != {RELEASE}:
        return []
    return sorted(found.written, key=lambda who: release_numbers(VersionedName.of(who[0]).which))


def _spans(
    group: Sequence[Configured], releases: Sequence[Configured], known: Mapping[Configured, str]
) -> list[str]:
    """Names of a group; of releases without a gap the first and the last one."""
    if not releases:
        return [known[who] for who in group]
    spans = [list(run) for inside, run in groupby(releases, group.__contains__) if inside]
    return [
        " to ".join([known[span[0]], *(VersionedName.of(who[0]).which for who in span[1:][-1:])])
        for span in spans
    ]


def _boundaries(found: Settled, releases: Sequence[Configured]) -> list[str]:
    """Where the end moves from one release to the next, and what moved start does the same."""
    told = []
    for before, after in pairwise(releases):
        gap, _ = found.apart(found.written[before], found.written[after])
        if gap > ALIKE:
            moved = found.explained(before, after)
            cause = "no start that was moved does so"
            if found.tried(before, after) is None:
                cause = "no moved start ended in both, so it may be noise"
            if moved is not None:
                cause = f"a start moved by {_mm(1000 * moved)} does so within one release"
            which = VersionedName.of(after[0]).which
            told.append(f"{which} moves the end by {_mm(gap)}: {cause}.")
    return told


def _alike(found: Settled, known: dict[Configured, str]) -> str:
    if len(known) < 2:
        return f"{found.scene} ran in {''.join(known.values())} alone, so nothing is compared."
    return f"As written, {found.scene} ends alike in all {len(known)}, within {_mm(ALIKE)}."


def _alone(found: Settled) -> list[str]:
    """What a moved start does where all end alike."""
    most = {
        moved: max((found.noise(who, moved) or 0.0 for who in found.written), default=0.0)
        for moved in found.moved
    }
    wide = [moved for moved, noise in most.items() if noise > max(ALIKE, 2000 * moved)]
    if not wide:
        return []
    return [
        f"But a start moved by {_mm(1000 * wide[0])} moves an end by up to {_mm(most[wide[0]])}: "
        "equal ends of one start are no sign that the simulators agree."
    ]


def _noise(found: Settled, pairs: Sequence[tuple[Configured, Configured]]) -> str:
    if not found.moved:
        return "No moved start was tried, so nobody knows whether this is more than noise."
    explained = [moved for pair in pairs if (moved := found.explained(*pair)) is not None]
    if len(explained) == len(pairs):
        return (
            f"A start moved by {_mm(1000 * max(explained))} moves the end within one simulator as "
            "far: the difference is the scene's own noise, and no cause can be told from it."
        )
    rest = [found.tried(*pair) for pair in pairs if found.explained(*pair) is None]
    known = [moved for moved in rest if moved is not None]
    if not known and not explained:
        return "No moved start ended in both, so nobody knows whether this is more than noise."
    largest = _mm(1000 * min(known, default=0.0))
    if len(known) == len(pairs):
        return (
            f"Starts moved by up to {largest} move no end so far: the difference is more than the "
            "start's noise."
        )
    told = [f"Of {len(pairs)} pairs that differ, moved starts explain {len(explained)}"]
    if known:
        others = "the others" if len(known) == len(rest) else f"{len(known)}"
        told.append(f"{others} differ by more than starts moved by up to {largest} do")
    if unknown := len(rest) - len(known):
        told.append(f"of {unknown} nobody knows, since no moved start ended in both")
    return "; ".join(told) + "."


def _finer(found: Settled, known: dict[Configured, str]) -> str:
    if not found.finer:
        return "No finer step was tried, so nobody knows whether an end is converged."
    finest = max(found.finer)
    ends = {who: tried for who, tried in found.finer[finest].items() if who in known}
    groups = found.places(ends)
    if not groups:
        return f"With steps {finest} times as fine no repetition finished."
    lost = [who for who in known if not any(who in group for group in groups)]
    pairs = _between(found, ends, groups)
    changes = {who: found.change(who, finest) for who in known}
    moving = [who for who, change in changes.items() if change is not None and change > ALIKE]
    how = f"still end in {len(groups)} ways" if pairs else "have no start in common"
    if len(groups) == 1:
        how = "all end alike"
    text = f"they {how}"
    if lost:
        others = f"the others {how}" if len(known) > len(lost) + 1 else "nothing is compared"
        text = f"there is no end of {_some(_spans(lost, _releases(found), known))}, and {others}"
    if pairs:
        gap = max(found.apart(ends[a], ends[b])[0] for a, b in pairs)
        text += f", up to {_mm(gap)} apart"
    text = f"With steps {finest} times as fine {text}"
    if not moving and None in changes.values():
        return f"{text}."
    if not moving:
        return f"{text}, where they ended before: the step is not to blame."
    told = _some(_spans(moving, _releases(found), known))
    return f"{text}; the end of {told} depends on the step, so it is not converged."


def _some(texts: Sequence[str]) -> str:
    return listed(texts, NAMED)


def _mm(value: float) -> str:
    return f"{significant(value, 2)} mm"


def _table(found: Settled) -> list[Column]:
    who = list(found.written)
    columns = [
        Column("simulator", names(who), left=True),
        Column("as written", [_ends(found.written[one], "") for one in who]),
    ]
    for moved, ends in found.moved.items():
        told = [_ends(ends.get(one), _number(found.noise(one, moved))) for one in who]
        columns.append(Column(f"moved by {_mm(1000 * moved)}", told))
    for finer, ends in found.finer.items():
        told = [_ends(ends.get(one), _number(found.change(one, finer))) for one in who]
        columns.append(Column(f"step / {finer}", told))
    cost = [found.cost.get(one) for one in who]
    told = [cells.MISSING if c is None else cells.number(c, 2) for c in cost]
    return [*columns, Column("CPU s/sim s", told)]


def _number(value: float | None) -> str:
    return "" if value is None else significant(value, 2)


def _ends(ends: Ends | None, number: str) -> str:
    if ends is None:
        return cells.MISSING
    crashed = f"{ends.crashed} crashed" if ends.crashed else ""
    share = "" if ends.premises is None else f"{100 * ends.premises:.0f} %"
    return " ".join(filter(None, [share, number, crashed])) or "ended"
