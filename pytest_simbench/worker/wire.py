"""Arrays on the wire: bytes with dtype and shape, inside the plain data that execnet carries."""

from __future__ import annotations

from typing import Any

import numpy as np


def pack(value: Any) -> Any:
    """Plain data from nested data with arrays, numpy scalars and tuples in it."""
    if isinstance(value, np.ndarray):
        array = np.asarray(value, order="C")
        return {"__array__": [array.dtype.str, list(array.shape), array.tobytes()]}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, dict):
        return {key: pack(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [pack(item) for item in value]
    return value


def unpack(value: Any) -> Any:
    """The inverse of `pack`; tuples come back as lists, arrays are writable."""
    if isinstance(value, dict):
        if "__array__" in value:
            dtype, shape, data = value["__array__"]
            return np.frombuffer(bytearray(data), dtype=dtype).reshape(shape)
        return {key: unpack(item) for key, item in value.items()}
    if isinstance(value, list):
        return [unpack(item) for item in value]
    return value
