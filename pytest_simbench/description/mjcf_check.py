"""Whether somebody's MJCF file may be given to a parser: no entities, no files from elsewhere, no
more than a worker can hold."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

from pytest_simbench.description.urdf_check import read_xml
from pytest_simbench.ground.errors import DescriptionError

MOST = {"body": 2000, "geom": 20_000}
"""Elements of a scene."""

ABOVE = 2
"""So many folders above its own may hold what a scene names: packages keep shared parts beside."""

MESHES = ("mesh", "hfield", "skin", "flexcomp")
FOLDERS = {**dict.fromkeys(MESHES, "meshdir"), "texture": "texturedir", "model": ""}
"""Elements that name a file, and what names its folder; a <model> stands beside the scene."""

SIDES = ("right", "left", "up", "down", "front", "back")
FILES = ("file", "content", *(f"file{side}" for side in SIDES))
"""Attributes that name one."""


def check_mjcf(path: str, room: Path | None = None, above: tuple[Path, ...] = ()) -> None:
    """Look at a file and all that it includes and attaches.

    Args:
        room: in which all its files must be; None: around the file.
        above: files that attach this one.

    Raises:
        DescriptionError: one sentence with the file and the line.
    """
    main = Path(path)
    root = main.parent.resolve()
    lines: dict[ET.Element, tuple[Path, int]] = {}
    room = room or _room(root)
    elements = _included(main, root, room, (), lines)
    folders: dict[str, str] = {}
    count = dict.fromkeys(MOST, 0)
    for element, times in elements.items():
        if element.tag == "compiler":
            assets = element.get("assetdir")
            for folder in ("meshdir", "texturedir"):
                told = element.get(folder, assets)
                if told is not None:
                    folders[folder] = told
        if element.tag in count:
            count[element.tag] += times
            if count[element.tag] > MOST[element.tag]:
                raise DescriptionError(
                    f"{path} has more than {MOST[element.tag]} elements <{element.tag}>, with "
                    "those that <replicate> makes; read a smaller scene"
                )
    for element in elements:
        folder = folders.get(FOLDERS.get(element.tag, ""), "")
        for key in FILES:
            if element.tag in FOLDERS and element.get(key):
                name = str(Path(folder) / element.attrib[key])
                other = _inside(name, root, room, lines[element])
                if element.tag == "model" and other not in (*above, main.resolve()):
                    check_mjcf(str(other), room, (*above, main.resolve()))


def _room(root: Path) -> Path:
    """The folder in which all files of a scene in the folder `root` must be: never a whole disk or
    a user's whole home."""
    home = Path.home()
    whole = {home, *home.parents, Path(root.anchor)}
    allowed = [path for path in root.parents[:ABOVE] if path not in whole]
    return allowed[-1] if allowed else root


def _included(
    path: Path,
    root: Path,
    room: Path,
    above: tuple[Path, ...],
    lines: dict[ET.Element, tuple[Path, int]],
    times: int = 1,
) -> dict[ET.Element, int]:
    """All elements of a file and of those that it includes, in order, and how often each is there
    where the file is `times`: <replicate> repeats what it holds."""
    own: dict[ET.Element, int] = {}
    xml = read_xml(str(path), "the scene", own)
    if xml.tag == "robot":
        raise DescriptionError(
            f"{path} is a URDF, no MJCF; call it .urdf, or give a robot as --robot"
        )
    lines.update({element: (path, line) for element, line in own.items()})
    found: dict[ET.Element, int] = {}
    often = {xml: times}
    for element in xml.iter():
        count = element.get("count") if element.tag == "replicate" else None
        inside = often[element] * (int(count[:9]) if count and count.isdecimal() else 1)
        often.update(dict.fromkeys(element, inside))
        if element.tag != "include":
            found[element] = often[element]
            continue
        other = _inside(element.get("file", ""), root, room, lines[element])
        if other in (*above, path.resolve()):
            raise DescriptionError(
                f"{path}, line {own[element]}: <include> of {other.name} runs in a circle"
            )
        if len(lines) > 5 * MOST["geom"]:
            raise DescriptionError(f"{path}, line {own[element]}: too much is included")
        found |= _included(other, root, room, (*above, path.resolve()), lines, often[element])
    return found


def _inside(name: str, root: Path, room: Path, at: tuple[Path, int]) -> Path:
    """A file that one in the folder `root` names, which lies in the folder `room`."""
    where = f"{at[0]}, line {at[1]}: the file {name!r:.200}"
    try:
        path = (root / name).resolve()
        there = path.is_file()
    except (OSError, ValueError, RuntimeError):
        raise DescriptionError(f"{where} is no path") from None
    if not path.is_relative_to(room):
        raise DescriptionError(f"{where} lies out of the folder {room} of the scene; put it there")
    if not there:
        raise DescriptionError(f"{where} is not there")
    return path
