"""Tensors in files of torch's first format, read without torch and without running what they say.

Such a file holds five pickles (a magic number, the format's version, facts of the machine, the
tensor with its storage left out, the storages' keys) and then each storage: its number of elements
as 8 bytes, and these. `torch.save` of torch before 1.6 wrote it; source: torch/serialization.py,
`_legacy_save`. A pickle can call any function. This reader knows the three names that a tensor
needs, makes plain data of them, and refuses all others.
"""

from __future__ import annotations

import io
import math
import pickle
from typing import Any

import numpy as np

from pytest_simbench.data.measured import DataError
from pytest_simbench.scene import FloatArray

MAGIC = 0x1950A86A20F9469CFC6C
VERSION = 1001

ELEMENTS = {"DoubleStorage": "<f8", "FloatStorage": "<f4"}
"""Storages of floating point numbers, and how numpy calls their elements."""

MOST = 10_000_000
"""Elements of a tensor."""


class _Plain(pickle.Unpickler):
    """Makes tuples of what a pickled tensor consists of."""

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) == ("torch._utils", "_rebuild_tensor_v2"):
            return lambda *parts: parts
        if (module, name) == ("collections", "OrderedDict"):
            return dict
        if module == "torch" and name in ELEMENTS:
            return name
        raise pickle.UnpicklingError(f"it asks for {module}.{name}")

    def persistent_load(self, pid: Any) -> Any:
        return pid


def read_tensor(data: bytes, what: str) -> FloatArray:
    """The one tensor in a file, as double precision.

    Args:
        data: the file's content.
        what: the file is, for messages.

    Raises:
        DataError: it holds something else.
    """
    file = io.BytesIO(data)
    try:
        magic, version, _, tensor, keys = (_Plain(file).load() for _ in range(5))
        if (magic, version) != (MAGIC, VERSION):
            raise ValueError("it does not begin like one")
        storage, offset, shape, stride, *_ = tensor
        _, kind, key, _, size, _ = storage
        if list(keys) != [key] or not 0 < size <= MOST:
            raise ValueError("it has not just one storage")
        (count,) = np.frombuffer(file.read(8), "<i8")
        elements = np.frombuffer(file.read(), ELEMENTS[kind])
        rows = math.prod(shape)
        contiguous = tuple(math.prod(shape[k + 1 :]) for k in range(len(shape)))
        columns = tuple(math.prod(shape[:k]) for k in range(len(shape)))
        if len(elements) != count or count != size or offset or rows != size:
            raise ValueError("it is cut off")
        if all(n == 1 or a == b for n, a, b in zip(shape, stride, contiguous, strict=True)):
            return elements.reshape(shape).astype(float)
        if all(n == 1 or a == b for n, a, b in zip(shape, stride, columns, strict=True)):
            return elements.reshape(shape, order="F").astype(float)
        raise ValueError("its elements lie in an unknown order")
    except Exception as error:  # pickle and struct have many for what is none
        raise DataError(f"{what} is no tensor as torch wrote them: {error}") from None
