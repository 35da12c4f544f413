"""What a policy gathers in one repetition is not in the next, whatever kind of policy it is."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from pytest_simbench.scene.policy import as_policy
from pytest_simbench.tasks import Reaching
from pytest_simbench.tasks.own import own


def acting(rows: list[int], seen: Any) -> int:
    """How often it was asked."""
    rows.append(seen)
    return len(rows)


class Object:
    def __init__(self, **held: Any) -> None:
        vars(self).update(rows=[], **held)

    def act(self, seen: Any) -> int:
        return acting(self.rows, seen)


def closure() -> Callable[[Any], int]:
    """Two functions that share a number, a list and an array; one calls itself."""
    number, rows, array, late = 0, [], np.zeros(1), None
    del late

    def add(more: int) -> None:
        nonlocal number, array, late
        if more:
            number, late = number + 1, True
            array += 1
            rows.append(more)
            add(more - 1)

    def act(seen: Any) -> int:
        add(1)
        return number if number == len(rows) == array[0] else -1

    return act


@pytest.mark.parametrize(
    "policy",
    [
        Object(), Object().act, closure(), Object(act=closure()), Object(act=partial(acting, [])),
        partial(acting, []), partial(closure()),
        partial(lambda seen, rows: acting(rows, seen), rows=[]),
        lambda seen, rows=[]: acting(rows, seen), lambda seen, *, rows=[]: acting(rows, seen),
    ],
)  # fmt: skip
def test_it_begins_anew(policy: Any) -> None:
    task = Reaching(policy)
    for _ in range(2):
        mine = as_policy(own(task).policy)
        assert [mine.act(0), mine.act(0)] == [1, 2]


class Counter:
    def __init__(self, **held: Any) -> None:
        self.asked = 0
        vars(self).update(held)

    def __call__(self, seen: Any) -> int:
        self.asked += 1
        return self.asked


@pytest.mark.parametrize("deep", [False, True])
def test_an_object_of_the_user_s_begins_anew_too(deep: bool) -> None:
    """Repetitions side by side went through one filter."""
    counter = Counter(within=Counter())
    policy = Object(count=counter, act=lambda seen: (counter.within if deep else counter)(seen))
    task = Reaching(policy)
    for _ in range(2):
        mine = own(task).policy
        assert [mine.act(0), mine.act(0)] == [1, 2]
        assert mine.count.asked == 2 * (not deep)  # the same one
    assert (counter.asked, counter.within.asked) == (0, 0)


class Uncopied(Object):
    def __reduce_ex__(self, protocol: Any) -> Any:
        raise TypeError


class Connection(Counter):
    def __del__(self) -> None:
        """Ends it."""


class Network(Counter, Namespace):
    """A part of its class is installed."""


@pytest.mark.parametrize("kind", [Uncopied, Connection, Network])
def test_networks_and_what_cannot_be_copied_are_shared(kind: type[Any]) -> None:
    network = kind()
    for policy in (lambda seen: network, partial(lambda held, seen: held, network)):
        assert own(Reaching(policy)).policy(0) is network
    assert own(Reaching(Object(network=network))).policy.network is network
    assert (own(Reaching(network)).policy is network) == (kind is Uncopied)


class Own(Reaching):
    def act(self, seen: Any) -> int:
        return acting(vars(self)["rows"], seen)


@pytest.mark.parametrize("which", [0, 1, 2])
def test_what_a_task_shares_with_its_policy_it_goes_on_sharing(which: int) -> None:
    """A task that counts what its policy did counted nothing."""
    rows: list[int] = []
    task, policy = Own(closure()), Object()
    policy.rows = rows  # type: ignore[attr-defined]
    vars(task).update(rows=rows, policy=(task.act, lambda seen: acting(rows, seen), policy)[which])
    mine = own(task)
    assert isinstance(mine, Own)
    as_policy(mine.policy).act(1)
    assert vars(mine)["rows"] == [1]
