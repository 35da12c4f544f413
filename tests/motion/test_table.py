"""Numbers of robot files: what must be above zero is refused at zero, and so is what is beside."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from pytest_simbench.motion.errors import RobotError
from pytest_simbench.motion.files import SMALLEST, read_robot
from pytest_simbench.motion.table import FileTable
from tests.motion.small_arm import TOML, small_arm

ABOVE_ZERO = {
    "arm": ("stiffness", "damping", "effort", "velocity", "acceleration", "jerk", "levers"),
    "hand": ("stiffness", "damping", "effort", "speed"),
}
AT_LEAST_ZERO = {"": ("friction", "hull_corners"), "arm": ("armature",), "hand": ("armature",)}


def with_value(table: str, key: str, value: float) -> str:
    """The file with another value; one that is there makes room."""
    text, head = TOML, f"[{table}]\n" if table else ""
    if table:
        first, _, rest = TOML.partition(head)
        own, bracket, after = rest.partition("\n[")
        kept = [line for line in own.splitlines() if not line.startswith(f"{key} =")]
        text = first + head + "\n".join(kept) + "\n" + bracket + after
    return text.replace(head, f"{head}{key} = {value}\n", 1) if head else f"{key} = {value}\n{text}"


@pytest.mark.parametrize(
    ("table", "key", "least"),
    [
        *((table, key, SMALLEST) for table, keys in ABOVE_ZERO.items() for key in keys),
        *((table, key, 0.0) for table, keys in AT_LEAST_ZERO.items() for key in keys),
    ],
)
def test_the_least_of_each_number(tmp_path: Path, table: str, key: str, least: float) -> None:
    read_robot(small_arm(tmp_path, with_value(table, key, least)))
    told = f"{key}: {least - 1e-7!r} is no number of at least {least:g}"
    with pytest.raises(RobotError) as refused:
        read_robot(small_arm(tmp_path, with_value(table, key, least - 1e-7)))
    assert str(refused.value).endswith(told)


@pytest.mark.parametrize(
    ("value", "told"),
    [
        (-1e6, ""), (-1.1e6, "-1100000.0 is no number of at least -1e+06"), (1e12, ""),
        (1.1e12, "1100000000000.0 is no number of at least -1e+06"),
        (True, "True is no number of at least -1e+06"), ("1", "'1' is no number of at least"),
        (float("nan"), "nan is no number of at least -1e+06"), (None, "v is missing"),
    ],
)  # fmt: skip
def test_what_is_a_number(value: object, told: str) -> None:
    readers = (FileTable.number, FileTable.some, lambda table, key: table.each(key, 1))
    for read in readers:
        listed = [value] if read is FileTable.some and value is not None else value
        table = FileTable({"v": listed}, "a.toml, [arm]")
        if told:
            with pytest.raises(RobotError, match=re.escape(told)):
                read(table, "v")
        else:
            assert read(table, "v") in (value, (value,))
            table.close()
