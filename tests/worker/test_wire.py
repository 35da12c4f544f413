"""Arrays survive the wire."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from pytest_simbench.worker.wire import pack, unpack

arrays = npst.arrays(
    st.sampled_from([np.float64, np.int64, np.uint8, np.bool_]),
    npst.array_shapes(min_dims=0, max_dims=3, min_side=0),
)


@given(arrays)
def test_arrays_come_back(array: np.ndarray) -> None:
    there = unpack(pack({"a": [array, {"b": array}]}))
    for back in (there["a"][0], there["a"][1]["b"]):
        assert back.dtype == array.dtype
        assert back.shape == array.shape
        assert np.array_equal(back, array, equal_nan=array.dtype.kind == "f")


def test_numpy_scalars_and_tuples_become_plain() -> None:
    assert pack({"x": np.float64(1.5), "y": (1, np.int32(2))}) == {"x": 1.5, "y": [1, 2]}


def test_what_the_wire_carries() -> None:
    array = np.arange(6.0).reshape(2, 3).T  # not in C's order
    packed = pack(array)
    assert packed == {"__array__": ["<f8", [3, 2], np.ascontiguousarray(array).tobytes()]}
    back = unpack(packed)
    assert np.array_equal(back, array)
    back[0, 0] = 7.0  # it may be written to
    assert pack(["a", None, 1, {"b": (2.5,)}]) == ["a", None, 1, {"b": [2.5]}]
    assert unpack({"a": [1, {"b": None}]}) == {"a": [1, {"b": None}]}
