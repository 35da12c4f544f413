"""XML that anybody may have made: of a bounded size, and without a document type."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from xml.parsers import expat

from pytest_simbench.simulator.errors import DescriptionError
from pytest_simbench.simulator.files import FileError, read_file

LARGEST_FILE = 16 * 2**20
"""Of a URDF or SRDF file [bytes]; the largest in example-robot-data have 0.3 MB."""

MOST_ELEMENTS = 100_000


def read_xml(path: str, what: str, lines: dict[ET.Element, int] | None = None) -> ET.Element:
    """The root element of an XML file without a document type, which could define entities.

    Args:
        path: of the file.
        what: the file is, for messages.
        lines: takes the line of each element.

    Raises:
        DescriptionError: no file, too large, or no such XML.
    """
    try:
        data = read_file(path, LARGEST_FILE, what)
    except FileError as error:
        raise DescriptionError(str(error)) from None
    builder, parser = ET.TreeBuilder(), expat.ParserCreate()
    count = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if count > MOST_ELEMENTS:
            raise DescriptionError(f"{path} has more than {MOST_ELEMENTS} elements")
        element = builder.start(tag, attributes)
        if lines is not None:
            lines[element] = parser.CurrentLineNumber

    def refuse(*_: object) -> None:
        raise DescriptionError(
            f"{path}, line {parser.CurrentLineNumber}: {what} has a document type (<!DOCTYPE>), "
            "which may define entities; leave it out"
        )

    handlers: dict[str, Callable[..., object]] = {
        "StartElementHandler": start,
        "EndElementHandler": builder.end,
        "CharacterDataHandler": builder.data,
        "StartDoctypeDeclHandler": refuse,
        "EntityDeclHandler": refuse,
    }
    for name, handler in handlers.items():
        setattr(parser, name, handler)
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise DescriptionError(f"{what} {path} is not valid XML: {error}") from None
    return builder.close()
