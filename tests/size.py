"""How large is the project? Prints a table and ends with exit status 1 above a ceiling.

    python tests/size.py

Python is counted in physical lines, Markdown in words, both of what git tracks. The budget is what
a part shall have at most; the ceiling is what has been reached, so that nothing grows unnoticed.
Whoever makes a part smaller lowers its ceiling.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Part:
    """A part of the project.

    Attributes:
        title: how the table names it.
        patterns: of git, for its files.
        budget: what it shall have at most, lines of Python or words of Markdown.
        ceiling: above this the script fails.
    """

    title: str
    patterns: tuple[str, ...]
    budget: int
    ceiling: int

    def size(self, root: Path) -> int:
        """Lines of its Python files and words of its Markdown files.

        Args:
            root: of a git checkout; what is not tracked there does not count.
        """
        listed = subprocess.run(
            ["git", "-c", "safe.directory=*", "ls-files", "-z", "--", *self.patterns],
            cwd=root, capture_output=True, text=True, check=True,
        ).stdout.split("\0")  # fmt: skip
        paths = [path for name in listed if name and (path := root / name).is_file()]
        texts = [(path.suffix, path.read_text("utf-8")) for path in paths]
        return sum(
            len(text.split()) if suffix == ".md" else text.count("\n") for suffix, text in texts
        )


PARTS = (
    Part("package and adapters", ("pytest_simbench/*.py", "sims/*.py"), 46_000, 71_189),
    Part("tests", ("tests/*.py",), 32_000, 55_722),
    Part("benchmarks", ("benchmarks/*.py",), 1_200, 1_313),
    Part("scripts of docs", ("docs/*.py",), 1_440, 1_580),
    Part("words of Markdown", ("*.md",), 45_000, 45_000),
)


def main(parts: Sequence[Part] = PARTS, root: Path = ROOT) -> int:
    print(f"{'':22}{'size':>9}{'budget':>9}{'ceiling':>9}")
    above = 0
    for part in parts:
        size = part.size(root)
        above += size > part.ceiling
        told = "  above the ceiling" if size > part.ceiling else ""
        print(f"{part.title:22}{size:9,}{part.budget:9,}{part.ceiling:9,}{told}")
    return min(above, 1)


if __name__ == "__main__":
    sys.exit(main())
