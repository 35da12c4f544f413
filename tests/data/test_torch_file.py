"""Tensors are read without torch, and a pickle that wants anything else is refused."""

from __future__ import annotations

import os
import pickle
from typing import Any

import numpy as np
import pytest

from pytest_simbench.data import DataError
from pytest_simbench.data.torch_file import MAGIC, VERSION, read_tensor
from tests.data.samples import torch_file

ROWS = np.arange(24.0).reshape(1, 4, 6)


@pytest.mark.parametrize(("kind", "order"), [("Double", "C"), ("Double", "F"), ("Float", "C")])
def test_a_tensor_is_what_torch_wrote(kind: str, order: Any) -> None:
    assert (read_tensor(torch_file(ROWS, kind, order), "x.pt") == ROWS).all()


@pytest.mark.parametrize("size", [0, 10, 100, 300, -8, -1])
def test_a_file_that_is_cut_off_is_none(size: int) -> None:
    with pytest.raises(DataError, match=r"^x\.pt is no tensor as torch wrote them: "):
        read_tensor(torch_file(ROWS)[:size], "x.pt")


def test_nothing_that_a_file_asks_for_is_run(capfd: pytest.CaptureFixture[str]) -> None:
    class Malicious:
        def __reduce__(self) -> tuple[Any, ...]:
            return os.system, ("echo run",)

    parts = [MAGIC, VERSION, {}, Malicious(), []]
    with pytest.raises(DataError, match=r"it asks for posix\.system"):
        read_tensor(b"".join(pickle.dumps(part, 2) for part in parts), "x.pt")
    assert capfd.readouterr().out == ""
