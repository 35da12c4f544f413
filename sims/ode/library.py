"""What pyode does not wrap, called in ODE's own library, which pyode has loaded.

Debian builds pyode without triangle meshes, and ODE with them. A `Mesh` puts itself into pyode's
table of geoms, so pyode's spaces and `collide` take it like any other.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.scene import FloatArray, Polytope, Pose
from pytest_simbench.simulator import lazy_import

ode = lazy_import("ode")

Vector = ctypes.c_double * 4
Matrix = ctypes.c_double * 12
"""dVector3 and dQuaternion, and dMatrix3, of a library with double precision."""

LO_STOP, HI_STOP, VELOCITY, MOST_FORCE, SOFTNESS = 0, 1, 2, 5, 8
"""Numbers of a joint's parameters (ode/common.h, D_ALL_PARAM_NAMES). pyode's ParamFMax (3) and all
after it are those of an older ODE, before two new ones came in between: they set something else."""

_ID, _REAL = ctypes.c_void_p, ctypes.c_double

GAVE_UP = 3
"""Number of the message that the solver found no solution (include/ode/error.h, d_ERR_LCP)."""

messages: list[int] = []
"""Numbers of ODE's messages since the list was emptied."""


def _take(number: int, text: bytes, values: int | None) -> None:
    messages.append(number)
    print(f"ODE message {number}: {text.decode()}")


_HANDLER = ctypes.CFUNCTYPE(None, ctypes.c_int, ctypes.c_char_p, _ID)(_take)
"""Of messages, in place of ODE's own (`dMessageFunction`)."""

_FUNCTIONS: dict[str, tuple[Any, Sequence[Any]]] = {
    "dRandSetSeed": (None, [ctypes.c_ulong]),
    "dRandGetSeed": (ctypes.c_ulong, []),
    "dCheckConfiguration": (ctypes.c_int, [ctypes.c_char_p]),
    "dGeomGetBody": (_ID, [_ID]),
    "dGeomSetBody": (None, [_ID, _ID]),
    "dGeomSetOffsetPosition": (None, [_ID, _REAL, _REAL, _REAL]),
    "dGeomSetOffsetQuaternion": (None, [_ID, Vector]),
    "dGeomSetPosition": (None, [_ID, _REAL, _REAL, _REAL]),
    "dGeomSetQuaternion": (None, [_ID, Vector]),
    "dGeomGetPosition": (ctypes.POINTER(_REAL), [_ID]),
    "dGeomGetQuaternion": (None, [_ID, Vector]),
    "dGeomSetCategoryBits": (None, [_ID, ctypes.c_ulong]),
    "dGeomSetCollideBits": (None, [_ID, ctypes.c_ulong]),
    "dGeomGetCategoryBits": (ctypes.c_ulong, [_ID]),
    "dGeomGetCollideBits": (ctypes.c_ulong, [_ID]),
    "dGeomIsEnabled": (ctypes.c_int, [_ID]),
    "dGeomDestroy": (None, [_ID]),
    "dGeomTriMeshDataCreate": (_ID, []),
    "dGeomTriMeshDataBuildDouble": (
        None,
        [_ID, _ID, ctypes.c_int, ctypes.c_int, _ID, ctypes.c_int, ctypes.c_int],
    ),
    "dGeomTriMeshDataPreprocess2": (ctypes.c_int, [_ID, ctypes.c_uint, _ID]),
    "dGeomTriMeshDataDestroy": (None, [_ID]),
    "dCreateTriMesh": (_ID, [_ID, _ID, _ID, _ID, _ID]),
    "dCreateConvex": (_ID, [_ID, _ID, ctypes.c_uint, _ID, ctypes.c_uint, _ID]),
    "dBodyGetQuaternion": (_ID, [_ID]),
    "dBodyGetRotation": (_ID, [_ID]),
    "dBodyGetLinearDamping": (_REAL, [_ID]),
    "dBodyGetAngularDamping": (_REAL, [_ID]),
    "dBodySetDamping": (None, [_ID, _REAL, _REAL]),
    "dBodySetLinearDampingThreshold": (None, [_ID, _REAL]),
    "dBodySetAngularDampingThreshold": (None, [_ID, _REAL]),
}
"""Result and arguments of each (include/ode/*.h of ODE 0.16)."""


@cache
def library() -> Any:
    """ODE's library, with the functions above declared.

    Raises:
        RuntimeError: it is of single precision, or has no triangle meshes.
    """
    found = ctypes.CDLL(library_path())
    for name, (result, arguments) in _FUNCTIONS.items():
        function = getattr(found, name)
        function.restype, function.argtypes = result, arguments
    for part in ("ODE_double_precision", "ODE_EXT_trimesh"):
        if not found.dCheckConfiguration(part.encode()):
            raise RuntimeError(f"{library_path()} was built without {part}")
    found.dSetMessageHandler(_HANDLER)
    return found


@cache
def library_path() -> str:
    """The file that pyode runs on; its name ends with the library's version."""
    assert ode.World  # loads it
    with open("/proc/self/maps", encoding="utf-8") as maps:
        for line in maps:
            path = line.split()[-1]
            if "/libode" in path:
                return path
    raise RuntimeError("pyode has loaded no library of ODE")


class _Own:
    """A geom that pyode does not know, usable where it takes one of its own."""

    def __init__(self, space: Any, geom: int) -> None:
        self._library, self._space, self._geom = library(), space, geom
        self.attribs: dict[str, Any] = {}  # as pyode's geoms have
        ode._geom_c2py_lut[geom] = self

    def __del__(self) -> None:
        if getattr(self, "_geom", None):
            self._library.dGeomDestroy(self._geom)

    def _id(self) -> int:
        return int(self._geom)

    def setBody(self, body: Any) -> None:
        self._library.dGeomSetBody(self._geom, body_id(body))


class Convex(_Own):
    """The convex hull of some corners, about whose origin a body turns.

    Args:
        space: of pyode, which the geom is put into.
    """

    def __init__(self, space: Any, hull: Polytope) -> None:
        depths = (hull.points @ hull.normals.T).max(axis=0)
        rings = [number for face in hull.faces for number in (len(face), *face)]
        # ODE does not copy them.
        self._planes: FloatArray = np.ascontiguousarray(np.column_stack([hull.normals, depths]))
        self._corners: FloatArray = np.ascontiguousarray(hull.points)
        self._rings: NDArray[np.uint32] = np.array(rings, dtype=np.uint32)
        made = library().dCreateConvex(
            space._id(),
            self._planes.ctypes.data,
            len(self._planes),
            self._corners.ctypes.data,
            len(self._corners),
            self._rings.ctypes.data,
        )
        super().__init__(space, made)


FACE_ANGLES = 1 << 1
"""`dTRIDATAPREPROCESS_BUILD_FACE_ANGLES` as a bit."""


class Mesh(_Own):
    """A triangle mesh.

    Args:
        space: of pyode, which the geom is put into.
        triangles: corners of each, (n, 3, 3) [m].
    """

    def __init__(self, space: Any, triangles: FloatArray) -> None:
        corners, numbers = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
        # ODE does not copy them.
        self._corners: FloatArray = np.ascontiguousarray(corners, dtype=np.float64)
        self._numbers: NDArray[np.uint32] = np.ascontiguousarray(numbers.ravel(), dtype=np.uint32)
        self._data = library().dGeomTriMeshDataCreate()
        library().dGeomTriMeshDataBuildDouble(
            self._data,
            self._corners.ctypes.data,
            self._corners.strides[0],
            len(self._corners),
            self._numbers.ctypes.data,
            len(self._numbers),
            3 * self._numbers.itemsize,
        )
        # without them ODE aborts where a convex body touches the mesh
        library().dGeomTriMeshDataPreprocess2(self._data, FACE_ANGLES, None)
        super().__init__(space, library().dCreateTriMesh(space._id(), self._data, None, None, None))

    def __del__(self) -> None:
        super().__del__()
        if getattr(self, "_geom", None):
            self._library.dGeomTriMeshDataDestroy(self._data)


def body_id(body: Any) -> int:
    """ODE's own name of a body. pyode tells those of geoms alone."""
    carrier = ode.GeomBox(None, (1.0, 1.0, 1.0))
    carrier.setBody(body)
    return int(library().dGeomGetBody(carrier._id()))


def turned(body: int) -> tuple[bytes, bytes]:
    """A body's quaternion and rotation matrix, bit for bit."""
    return (
        ctypes.string_at(library().dBodyGetQuaternion(body), ctypes.sizeof(Vector)),
        ctypes.string_at(library().dBodyGetRotation(body), ctypes.sizeof(Matrix)),
    )


def turn(body: int, quaternion: bytes, matrix: bytes) -> None:
    """Put back what `turned` gave; `dBodySetQuaternion` would normalise it, and so round it."""
    ctypes.memmove(library().dBodyGetQuaternion(body), quaternion, len(quaternion))
    ctypes.memmove(library().dBodyGetRotation(body), matrix, len(matrix))


def place(geom: Any, pose: Pose, body: Any = None) -> None:
    """Fix a geom at `pose` in the frame of a body, or in the world."""
    if body is not None:
        geom.setBody(body)
    kind = "Offset" if body is not None else ""
    getattr(library(), f"dGeomSet{kind}Position")(geom._id(), *pose.position)
    getattr(library(), f"dGeomSet{kind}Quaternion")(geom._id(), Vector(*pose.quaternion))


def pose_of(geom: Any) -> Pose:
    """Where a geom is in the world."""
    turn = Vector()
    library().dGeomGetQuaternion(geom._id(), turn)
    return Pose.from_array([*library().dGeomGetPosition(geom._id())[:3], *turn])


def damping(body: Any) -> FloatArray:
    """Shares of its linear and angular velocity that a body loses in a step, (2,)."""
    tell, name = library(), body_id(body)
    return np.array([tell.dBodyGetLinearDamping(name), tell.dBodyGetAngularDamping(name)])


def set_damping(body: Any, shares: FloatArray) -> None:
    """Have a body lose these shares of its linear and angular velocity in a step, at any speed."""
    if shares.any():
        tell, name = library(), body_id(body)
        tell.dBodySetDamping(name, *shares.tolist())
        tell.dBodySetLinearDampingThreshold(name, 0.0)
        tell.dBodySetAngularDampingThreshold(name, 0.0)
