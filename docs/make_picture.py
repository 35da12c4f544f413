"""Writes docs/pictures/first_test.svg: what the README's first command prints. Runs the command.

python docs/make_picture.py [NUMBER]      NUMBER repetitions instead of the README's, to try it
"""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from rich._export_format import CONSOLE_SVG_FORMAT
from rich.console import Console
from rich.text import Text

HERE = Path(__file__).resolve().parent
PICTURE = HERE / "pictures" / "first_test.svg"

COLUMNS = 100
"""Width of the terminal."""

SHOWN = (r"^=+ simulator comparison", r"^report: ")
"""The picture shows the lines from the first pattern to the second one."""

LAST = r" passed| failed"
"""The picture ends with the line of this pattern."""


def readme() -> tuple[str, list[str]]:
    """The first test in the README, and the command behind it."""
    text = (HERE.parent / "README.md").read_text("utf-8")
    code, command = (re.search(rf"```{kind}\n(.*?)```", text, re.S) for kind in ("python", "sh"))
    if not (code and command):
        raise ValueError("README.md begins with no test and no command")
    return code[1], command[1].split()


def printed(code: str, command: list[str]) -> str:
    """What the command prints to a terminal."""
    variables = {**os.environ, "COLUMNS": str(COLUMNS), "TERM": "xterm-256color"}
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "test_throwing.py").write_text(code, "utf-8")
        near, far = pty.openpty()
        process = subprocess.Popen(
            [sys.executable, "-m", *command], cwd=folder, env=variables, stdout=far, stderr=far
        )
        os.close(far)
        chunks = []
        while True:
            try:
                chunk = os.read(near, 65536)
            except OSError:  # Linux: the other end is closed
                break
            chunks.append(chunk)
            os.write(1, chunk)
        process.wait()
        os.close(near)
    return b"".join(chunks).decode("utf-8", "replace")


def lines(text: str) -> list[Text]:
    """The lines that the picture shows; of a line that was overwritten the last state."""
    found = []
    for line in text.replace("\r\n", "\n").split("\n"):
        last = re.sub(r"\x1b\[[0-9;?]*[ABCDGHJKhl]", "", line).rstrip("\r").split("\r")[-1]
        found.append(Text.from_ansi(last))
    plain = [line.plain for line in found]
    first, last = (next(i for i, p in enumerate(plain) if re.search(s, p)) for s in SHOWN)
    end = max(i for i, line in enumerate(plain) if re.search(LAST, line))
    return [*found[first : last + 1], found[end]]


def main() -> None:
    code, command = readme()
    if len(sys.argv) > 1:
        command = [re.sub(r"--reps=\d+", f"--reps={sys.argv[1]}", part) for part in command]
    console = Console(record=True, width=COLUMNS + 1, file=open(os.devnull, "w"))  # noqa: SIM115
    console.print(Text(f"$ {' '.join(command)}"))
    for line in lines(printed(code, command)):
        console.print(line, no_wrap=True, crop=True, highlight=False)
    # The font of rich's own format would be fetched from the network.
    form = re.sub(r"@font-face \{\{.*?\}\}\n", "", CONSOLE_SVG_FORMAT, flags=re.S)
    svg = console.export_svg(title="pytest-simbench", code_format=form)
    PICTURE.write_text(svg.replace("Fira Code", "monospace"), "utf-8")


if __name__ == "__main__":
    main()
