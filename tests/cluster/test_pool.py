"""Which node a repetition goes to, without any network."""

from __future__ import annotations

import threading
from collections.abc import Iterable

import pytest

from pytest_simbench.cluster import pool as module
from pytest_simbench.cluster.offers import Node
from pytest_simbench.cluster.pool import Pool
from tests.cluster.test_offers import lab


class Told(Pool):
    """Knows what it is told, and asks no scheduler."""

    def __init__(self, nodes: Iterable[Node]) -> None:
        self._begin()
        self._known = {node.address: node for node in nodes}

    def _look(self) -> None:
        pass


A, B = lab("a", "mujoco==4.0"), lab("b", "mujoco==4.0")


def taken(pool: Pool, *avoid: str) -> str | None:
    """The name of the node that the next repetition gets."""
    found = pool.reserve(lambda node: node.has("mujoco", "headless"), avoid, threading.Event())
    return None if found is None else found[1].name


def test_one_repetition_for_each_slot() -> None:
    pool = Told([A, B])
    assert {taken(pool), taken(pool)} == {"a", "b"}
    soon = threading.Timer(0.3, lambda: pool.release(next(iter(pool._mine))))
    soon.start()
    assert taken(pool) in ("a", "b")  # once one is free
    soon.join()


def test_what_is_tried_again_goes_elsewhere_where_it_can() -> None:
    for avoid, other in (("a", "b"), ("b", "a")):
        assert taken(Told([A, B]), avoid) == other
    assert taken(Told([A]), "a") == "a"


def test_a_node_that_was_given_up_gets_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PATIENCE", 0.5)
    pool = Told([A, lab("c", "drake==1.51")])
    pool.give_up(A)
    assert taken(pool) is None  # nobody else offers it


def test_waiting_ends_when_the_run_does() -> None:
    pool, stop = Told([]), threading.Event()
    threading.Timer(0.3, stop.set).start()
    assert pool.reserve(lambda node: True, (), stop) is None
