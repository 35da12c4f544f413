"""Names of files: safe in any folder, and different for different things."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from typing import Any

LONGEST = 80
"""Characters of the readable part: with digest, number and ending far below the 255 of Linux."""

_PLAIN = re.compile(r"[a-z0-9_]([a-z0-9_.=-]*[a-z0-9_])?")
_UNSAFE = re.compile(r"[^A-Za-z0-9_.=-]+")
_DIGEST = re.compile(r"-[0-9a-f]{10}$")


def file_name(shown: str, *identity: object) -> str:
    """A file's name without its ending.

    What is safe as it is (small letters, digits, `_ . = -`) stays. Everything else loses what no
    file system takes, and gets a digest of the whole: two things never share a name, also where
    they differ in case alone, in what was left out, or in `identity`, which is not shown.

    Args:
        shown: the readable part.
        identity: what else tells the thing apart.
    """
    plain = len(shown) <= LONGEST and _PLAIN.fullmatch(shown)
    # What ends like a digest could be the name of something else.
    if plain and not identity and not _DIGEST.search(shown):
        return shown
    safe = _UNSAFE.sub("_", shown)[:LONGEST].strip("._-=") or "unnamed"
    return f"{safe}-{digest(shown, *identity)}"


def digest(*parts: object) -> str:
    """Ten hexadecimal digits that tell these texts apart."""
    data = "\0".join(f"{len(str(part))}:{part}" for part in parts)
    return hashlib.sha256(data.encode("utf-8", "surrogatepass")).hexdigest()[:10]


def data_digest(data: Mapping[str, Any], length: int) -> str:
    """So many hexadecimal digits that tell data as for JSON apart. In the last digits of what is
    computed processors differ, so ten digits and at most twelve decimals of a number count."""
    text = json.dumps(_rounded(data), sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:length]


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{round(value, 12) + 0.0:.10g}")
    if isinstance(value, Mapping):
        return {key: _rounded(item) for key, item in value.items()}
    return [*map(_rounded, value)] if isinstance(value, list | tuple) else value
