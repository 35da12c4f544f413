"""Who gets a slot of the machine, when several processes want one."""

from __future__ import annotations

import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import pytest

from pytest_simbench.client.errors import ExecutorError
from pytest_simbench.experiment.slots import NOW, Slots, key_of, slot


@pytest.fixture
def slots() -> Iterator[Slots]:
    found = Slots(1)
    yield found
    found.close()


def held_for(slots: Slots, test: str, seconds: float) -> None:
    with slot(slots.address, test, lambda: False) as granted:
        assert granted
        time.sleep(seconds)


def test_the_unknown_come_first_then_the_longest_and_what_no_test_wants_last(
    slots: Slots,
) -> None:
    slots._ended |= {NOW + key_of("long"): (100, 6000.0), NOW + key_of("short"): (100, 100.0)}
    order: list[str] = []

    def wait(test: str) -> None:
        with slot(slots.address, test, lambda: False, later=test == "later"):
            order.append(test)

    names = ["later", "short", "long", "new", "short", "long"]
    waiting = [threading.Thread(target=wait, args=(name,)) for name in names]
    with slot(slots.address, "first", lambda: False):
        for thread in waiting:
            thread.start()
        while len(slots._waiting) < len(names):
            time.sleep(0.01)
        assert not order
    for thread in waiting:
        thread.join()
    assert order == ["new", "long", "long", "short", "short", "later"]


def test_it_is_told_how_long_a_repetition_took(slots: Slots) -> None:
    held_for(slots, "mine", 0.1)
    held_for(slots, "other", 0.0)  # now the end of the first was heard
    assert 0.1 <= slots._rank(NOW + key_of("mine"))[1] < float("inf")


def test_a_process_that_is_killed_gives_its_slot_back(slots: Slots) -> None:
    code = (
        "import socket, sys, time; found = socket.socket(socket.AF_UNIX); "
        "found.connect(chr(0) + sys.argv[1]); found.send(b'n' * 17); print(found.recv(1)); "
        "sys.stdout.flush(); time.sleep(600)"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, slots.address], stdout=subprocess.PIPE
    ) as other:
        assert other.stdout is not None
        other.stdout.readline()
        looks = iter([False, False, True])
        with slot(slots.address, "mine", lambda: next(looks)) as granted:
            assert not granted  # it waited, and was stopped
        other.kill()
    held_for(slots, "mine", 0.0)


def test_who_waits_hears_that_the_run_is_gone(slots: Slots) -> None:
    with slot(slots.address, "held", lambda: False):
        threading.Timer(0.1, slots.close).start()
        with (
            pytest.raises(ExecutorError, match="is gone"),
            slot(slots.address, "mine", lambda: False),
        ):
            pass
    with pytest.raises(ExecutorError, match="is gone"), slot(slots.address, "x", lambda: False):
        pass


def test_who_was_heard_by_nobody_hears_that_the_run_is_gone() -> None:
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind("")  # an address of its own, that of Linux's abstract names
        listener.listen()
        address = listener.getsockname()[1:].decode()
        threading.Timer(0.1, listener.close).start()
        with (
            pytest.raises(ExecutorError, match="is gone"),
            slot(address, "mine", lambda: False),
        ):
            pass
