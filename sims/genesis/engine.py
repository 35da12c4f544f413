"""Genesis itself: how it is started quickly, and its tensors' values.

Runs in Genesis' own interpreter.
"""

from __future__ import annotations

import dataclasses
import gc
import importlib
import inspect
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.scene import FloatArray
from pytest_simbench.simulator import lazy_import

genesis = lazy_import("genesis")


def start_engine(precision: str) -> None:
    """Initialise Genesis, which a process does once for each precision.

    What lives then, 3000 modules, lives on: Python's garbage collector need not look at it in each
    world's end. Measured: 0.26 CPU s for each world, 0.01 without.
    """
    if genesis._initialized:
        if genesis.np_float == np.dtype(f"float{precision}"):
            return
        genesis.destroy()
    genesis.init(backend=genesis.cpu, precision=precision, logging_level="warning", seed=0)
    with quick_inspection():
        importlib.import_module("genesis.engine.simulator")
    gc.collect()
    gc.freeze()


@contextmanager
def quick_inspection() -> Iterator[None]:
    """Spare the import of Genesis' solvers most of its time.

    Every function with Quadrants' decorators asks `inspect` about the frame that imports it. Those
    of Python's own import system have no source file, and `inspect.getmodule` looks through all
    3000 modules before it answers None, 2000 times. Measured on 2 cores: 6.9 s of CPU, 0.8 s when
    the answer is given at once.
    """
    original = inspect.getmodule

    def getmodule(object: Any, _filename: Any = None) -> Any:
        code = object.f_code if inspect.isframe(object) else object
        if inspect.iscode(code) and code.co_filename.startswith("<frozen "):
            return None
        return original(object, _filename)

    inspect.getmodule = getmodule
    try:
        yield
    finally:
        inspect.getmodule = original


def forget_worlds() -> None:
    """Let go of the worlds that are gone, of which the engine keeps every tensor: 30 MB of each.

    Quadrants times two implementations of the constraint solver's body and notes the faster one
    under a key that Genesis makes of all arguments, the world's tensors themselves
    (`perf_dispatch(get_geometry_hash=...)` in genesis 1.2.3). No later world has the same key, so
    nothing is lost with the notes.
    """
    solver = importlib.import_module("genesis.engine.solvers.rigid.constraint.solver")
    notes = vars(solver.func_solve_body)
    for name, value in notes.items():
        if name.endswith("_by_geometry_hash") or name == "_first_eval_completed":
            value.clear()
    notes.update(dict.fromkeys(("_cached_args", "_cached_kwargs", "_cached_impl")))


def numbers(tensor: Any) -> FloatArray:
    """A PyTorch tensor or an array, in double precision."""
    return np.asarray(tensor.cpu() if hasattr(tensor, "cpu") else tensor, dtype=float)


def array_of(tensor: Any, *, copy: bool = True) -> NDArray[Any]:
    """Values of one of the engine's tensors, or its own memory.

    The tensors' `to_numpy` and `from_numpy` would compile and launch kernels.
    """
    values: NDArray[Any] = genesis.utils.misc.qd_to_numpy(tensor, copy=copy)
    return values


def tensors_in(struct: Any) -> Iterator[Any]:
    """Every tensor of nested dataclasses, in their order."""
    if dataclasses.is_dataclass(struct):
        for field in dataclasses.fields(struct):
            yield from tensors_in(getattr(struct, field.name))
    elif hasattr(struct, "to_numpy"):
        yield struct


OLDEST = "1.2.3"
"""The oldest one that runs: before, there was no elliptic friction cone, which the profile `tuned`
asks for (1.0.0, 1.1.2 and 1.2.0 to 1.2.2 have no `genesis.friction_cone`)."""


def centre_of_mass() -> Any:
    """How a link's centre of mass is named where one asks for its velocity or pushes there: 1.4
    has an enumeration for it, the older one a text."""
    frames = getattr(genesis, "link_ref_frame", None)
    return "link_com" if frames is None else frames.link_COM


def contact_parameters(geom: Any) -> FloatArray:
    """What a shape's contacts are solved with, as MuJoCo's `solref` and `solimp`, (7,).

    The shape of 1.4 has a method for it, the older one a property.
    """
    told = geom.get_sol_params() if hasattr(geom, "get_sol_params") else geom.sol_params
    parameters: FloatArray = told.cpu().numpy().copy()
    return parameters


def of_collider(collider: Any, name: str) -> Any:
    """Its `collider_state` or `collider_info`: before 1.4 their names began with `_`."""
    return getattr(collider, name, None) or getattr(collider, f"_{name}")


def keep_apart(collider: Any, links: Mapping[str, Any], pairs: Iterable[tuple[str, str]]) -> None:
    """Take the shapes of pairs of links out of the collider's table."""
    table = array_of(of_collider(collider, "collider_info").collision_pair_idx, copy=False)
    for pair in pairs:
        first, second = ([shape.idx for shape in links[name].geoms] for name in pair)
        table[np.ix_(first, second)] = table[np.ix_(second, first)] = -1
