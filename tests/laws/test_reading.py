"""What each law reads of a motion that is made up, and what it allows there, as approved: who
changes a formula sees it here. That laws are right, `test_laws` asks of engines."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from pytest_simbench.laws import LAWS, Law
from tests.approval import assert_approved_line
from tests.made_up_world import MadeUp

OTHER = {"speed": 1.1, "spin": 0.2, "direction": 0.3, "moment": 1.3}
"""For what is 0 or 1 of a law: by 1 one may multiply and divide, and 0 may be left out."""

OTHERS = [replace(law, **{n: OTHER[n] for n in OTHER if getattr(law, n, 2) in (0.0, 1.0)})  # type: ignore[type-var]
          for law in LAWS]  # fmt: skip


@pytest.mark.parametrize("law", dict.fromkeys([*LAWS, *OTHERS]), ids=lambda law: law.name)
def test_a_law_reads_this_of_a_made_up_motion(law: Law) -> None:
    small = law.smoke()
    world: Any = MadeUp(small.build())
    found = small.measure(world)
    numbers = (f"{number + 0.0:.6g}" for number in (found.value, found.exact, found.tolerance))
    told = f"{', '.join(numbers)} {law.unit}".strip()
    assert_approved_line("read", f"{law.name}: {told} in {world.time:.2f} s")
