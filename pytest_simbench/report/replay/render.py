"""The replay as one HTML file: trimesh's viewer of the meshes, and our player beside it.

trimesh's page holds three.js and a viewer whose `scene`, `camera`, `renderer` and `render` are
global. The player takes `render` over: it draws every simulator into its own tile.
"""

from __future__ import annotations

import hashlib
import json
import re
import zlib
from base64 import b64encode
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

import numpy as np

from pytest_simbench.ground.text import in_one_line
from pytest_simbench.recordings.bag import METAL
from pytest_simbench.recordings.figure import Figure, Mesh
from pytest_simbench.recordings.trace import Trace, TraceError
from pytest_simbench.report.replay.recorded import Group
from pytest_simbench.scene import Body, Box, Pose, Solid

INSTALL = "no replay in 3-D: pip install 'pytest-simbench[replay]'"

LARGEST = 12_000_000
"""Of all motions in a page [bytes]; further seeds are left out."""

SCALE = 10_000
"""Steps of a motion per unit: 0.1 mm, 0.1 mrad, 0.1 ms."""

FARTHEST = 1e4
"""Nothing is drawn farther away [m]."""


class ReplayUnavailable(ImportError):
    """trimesh is not installed; the message says how to install it."""


def replay_of(shown: Sequence[Group]) -> tuple[str, int, list[str]]:
    """The page of `groups`.

    Returns:
        The page as HTML, how many of the groups it holds (the first ones), and what could not be
        shown, one sentence each. Without a single trace that can be read there is no page: "".

    Raises:
        ReplayUnavailable: trimesh is not installed.
    """
    meshes = _Meshes()
    told: list[dict[str, Any]] = []
    problems: list[str] = []
    size = 0
    for group in shown:
        tiles: list[dict[str, Any]] = []
        several = len({record.simulator for record, _ in group.shown}) < len(group.shown)
        for record, path in group.shown:
            try:
                trace = Trace.read(path)
            except TraceError as error:
                problems.append(f"no replay: {error}")
                continue
            tiles.append(
                {
                    "label": in_one_line(record.label if several else record.simulator),
                    "status": record.status,
                    "repetition": record.repetition,
                    "motion": packed(trace),
                    "samples": len(trace.time),
                    "phases": [[time, in_one_line(name)] for time, name in trace.phases],
                    "joints": list(trace.joint_names),
                    "boxes": [meshes.body(body) for body in trace.boxes],
                    "free": len(trace.free),
                    "figure": meshes.figure(trace.figure),
                }
            )
        told.append({"task": in_one_line(group.task), "seed": str(group.seed), "tiles": tiles})
        size += sum(len(tile["motion"]) for tile in tiles)
        if size > LARGEST:
            break
    if len(told) < len(shown):
        problems.append(f"the replay shows {len(told)} of {len(shown)} seeds: more would not fit")
    if not size:
        return "", 0, problems
    data = {"groups": told, "scale": SCALE, "metal": METAL}
    return _page(meshes.viewer(), data), len(told), list(dict.fromkeys(problems))


def packed(trace: Trace) -> str:
    """A motion as packed text (zlib, base64): time, then each joint's position, then seven columns
    a free body, (columns, n) whole numbers in `SCALE`, each as the difference to the one before.
    What stands still is zeros then, and packs to nothing."""
    bodies = trace.bodies[:, :, :7].reshape(len(trace.time), -1)
    table = np.column_stack([trace.time, trace.joints[:, 0], bodies])
    columns = np.rint(np.clip(table, -FARTHEST, FARTHEST) * SCALE).T.astype("<i4")
    steps = np.diff(columns, axis=1, prepend=0).astype("<i4")
    return b64encode(zlib.compress(steps.tobytes(), 9)).decode("ascii")


class _Meshes:
    """The meshes of all robots and bodies, each once."""

    def __init__(self) -> None:
        self._found: dict[bytes, int] = {}
        self._meshes: list[Mesh] = []

    def figure(self, figure: Figure | None) -> dict[str, Any] | None:
        """What the player needs of a robot; parts name meshes of the viewer."""
        if figure is None:
            return None
        numbers = [self._number(mesh) for mesh in figure.meshes]
        return {
            "root": figure.root,
            "hinges": [
                {**hinge.__dict__, "origin": list(hinge.origin.as_array())}
                for hinge in figure.hinges
            ],
            "parts": [
                {
                    "link": part.link,
                    "pose": list(part.pose.as_array()),
                    "size": part.size,
                    "mesh": None if part.mesh is None else numbers[part.mesh],
                }
                for part in figure.parts
            ],
        }

    def body(self, body: Body) -> dict[str, Any]:
        """What the player needs of a body: the size of a box, or the solids of another."""
        told = {"colour": body.colour, "pose": list(_array(body.pose))}
        if isinstance(body, Box):
            return {"size": body.size, **told}
        return {"solids": [self._solid(solid) for solid in body.solids()], **told}

    def _solid(self, solid: Solid) -> dict[str, Any]:
        pose = _array(solid.pose)
        if solid.kind == "mesh":
            mesh = Mesh(*(np.array(rows) for rows in solid.mesh))
            return {"mesh": self._number(mesh), "pose": pose}
        return {"kind": solid.kind, "size": solid.extents, "pose": pose}

    def _number(self, mesh: Mesh) -> int:
        key = hashlib.sha256(mesh.triangles.tobytes()).digest()
        if key not in self._found:
            self._found[key] = len(self._meshes)
            self._meshes.append(mesh)
        return self._found[key]

    def viewer(self) -> str:
        """trimesh's page: `box`, `ball` and `tube` of edge length or diameter 1, and the meshes
        `mesh_0`, `mesh_1`, ..."""
        try:
            import trimesh
            from trimesh.viewer.notebook import scene_to_html
        except ImportError:
            raise ReplayUnavailable(INSTALL) from None
        scene = trimesh.Scene()
        make = trimesh.creation
        solids = {
            "box": make.box(),
            "ball": make.icosphere(3, 0.5),
            "tube": make.cylinder(0.5, 1.0),
        }
        for name, solid in solids.items():
            scene.add_geometry(solid, node_name=name, geom_name=name)
        for k, mesh in enumerate(self._meshes):
            triangles = trimesh.Trimesh(
                np.asarray(mesh.vertices, dtype=float), mesh.faces, process=False
            )
            scene.add_geometry(triangles, node_name=f"mesh_{k}", geom_name=f"mesh_{k}")
        return str(scene_to_html(scene))


def _array(pose: Pose) -> list[float]:
    return [float(value) for value in pose.as_array()]


def _page(viewer: str, data: dict[str, Any]) -> str:
    """The viewer's page with our style and player in it."""
    body, style, script = map(_part, ("body.html", "replay.css", "replay.js"))
    # No text of the run can end the element: JSON without `<`.
    content = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    player = (
        f'<script type="application/json" id="data">{content}</script><script>{script}</script>'
    )
    page = viewer.replace("</body>", f"{body}{player}</body>", 1)
    page = re.sub("<title>.*?</title>", "<title>Replay of simulators</title>", page, count=1)
    page = re.sub('<meta name="viewport".*?>', "", page, count=1, flags=re.DOTALL)
    scripts = list(re.findall(r"<script>(.*?)</script>", page, re.DOTALL))
    digests = " ".join(f"'sha256-{_digest(found)}'" for found in scripts)
    # The viewer loads its meshes from an address that is their content; nothing else is loaded.
    policy = (
        f"default-src 'none'; script-src {digests}; style-src 'unsafe-inline'; connect-src data:; "
        "img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
    head = (
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta name="color-scheme" content="light dark"><style>{style}</style></head>'
    )
    return page.replace("</head>", head, 1)


def _part(name: str) -> str:
    return (files(__package__) / "templates" / name).read_text(encoding="utf-8")


def _digest(script: str) -> str:
    return b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
