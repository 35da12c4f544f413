"""Made-up data sets, in the forms of the real ones."""

from __future__ import annotations

import io
import pickle
import struct
import sys
import tarfile
import types
from collections import OrderedDict
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pytest_simbench.data import tosses
from pytest_simbench.data.torch_file import MAGIC, VERSION
from pytest_simbench.scene import STANDARD_GRAVITY, FloatArray


def torch_file(
    array: FloatArray, kind: str = "Double", order: Literal["C", "F", "A"] = "C"
) -> bytes:
    """As `torch.save` wrote a tensor before torch 1.6."""
    fakes = {name: types.ModuleType(name) for name in ("torch", "torch._utils")}
    storage = type(f"{kind}Storage", (), {"__module__": "torch"})
    setattr(fakes["torch"], storage.__name__, storage)

    def rebuild(*parts: Any) -> None: ...

    rebuild.__module__, rebuild.__name__ = "torch._utils", "_rebuild_tensor_v2"
    rebuild.__qualname__ = rebuild.__name__
    fakes["torch._utils"]._rebuild_tensor_v2 = rebuild  # type: ignore[attr-defined]

    class Tensor:
        def __reduce__(self) -> tuple[Any, ...]:
            laid = np.asarray(array, order=order)
            stride = tuple(step // laid.itemsize for step in laid.strides)
            return rebuild, (Key(), 0, array.shape, stride, False, OrderedDict())

    class Key: ...

    class Pickler(pickle.Pickler):
        def persistent_id(self, thing: Any) -> Any:
            return (
                ("storage", storage, "7", "cpu", array.size, None) if type(thing) is Key else None
            )

    file = io.BytesIO()
    pickle.dump(MAGIC, file, 2)
    pickle.dump(VERSION, file, 2)
    pickle.dump({"little_endian": True}, file, 2)
    before = {name: sys.modules.get(name) for name in fakes}
    sys.modules.update(fakes)
    try:
        Pickler(file, 2).dump(Tensor())
    finally:
        for name, module in before.items():
            if module is None:
                del sys.modules[name]
            else:
                sys.modules[name] = module
    pickle.dump(["7"], file, 2)
    elements = np.asarray(array, {"Double": "<f8", "Float": "<f4"}[kind])
    file.write(struct.pack("<q", array.size) + elements.tobytes(order))
    return file.getvalue()


def falling(rows: int = 20, speed: float = 1.0) -> FloatArray:
    """States of a cube that flies freely, as in the tosses: no contact, no turn, (rows, 13)."""
    time = np.arange(rows) / tosses.RATE
    state = np.zeros((rows, 13))
    state[:, 0] = speed * time
    state[:, 2] = 0.3 + STANDARD_GRAVITY[2] * time**2 / 2
    state[:, 3] = 1.0
    state[:, 7] = speed
    state[:, 9] = STANDARD_GRAVITY[2] * time
    return state


def source_file(state: FloatArray) -> bytes:
    """A toss as the public source has it."""
    tensor = np.zeros((1, len(state), 19))
    tensor[0, :, :13] = state
    tensor[0][:, [0, 1, 2, 7, 8, 9]] /= tosses.EDGE / 2
    return torch_file(tensor)


def archive(files: Mapping[str, bytes], path: Path) -> Path:
    """As GitHub packs a commit: everything in a folder."""
    with tarfile.open(path, "w:gz") as packed:
        for name, content in files.items():
            item = tarfile.TarInfo(f"repository-0123456/{name}")
            item.size = len(content)
            packed.addfile(item, io.BytesIO(content))
    return path


def edited(name: str, value: Any) -> Callable[[dict[str, Any]], None]:
    """Puts a wrong value into the arrays of a data set."""
    return lambda found: found.update({name: value})
