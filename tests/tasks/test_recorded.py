"""What a policy or a task takes from elsewhere is a part of it, and how it is laid out is none."""

from __future__ import annotations

import importlib
import linecache
import sys
from pathlib import Path

import pytest

from pytest_simbench.tasks.recorded import digest

HEAD = "import functools\nimport numpy as np\nimport other\nfrom other import far\nG = 0.5\n"
CLASS = "class P:\n    def act(self, seen):\n        return {}\n"
STATIC = "    @staticmethod\n    def g():\n        return G\n"
PROPERTY = "    @property\n    def g(self):\n        return G\n"
OTHER = "V = 0.5\nclass Made:\n    def go(self): return 0.5\ndef far(): return 0.5\nmade = Made()\n"


def of(folder: Path, text: str, other: str) -> str:
    """The digest of the policy that a file makes, beside another file."""
    folder.mkdir(exist_ok=True)
    (folder / "policy.py").write_text(text)
    (folder / "other.py").write_text(other)
    linecache.checkcache()
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        patch.setattr(sys, "dont_write_bytecode", True)
        for name in ("other", "policy"):
            patch.delitem(sys.modules, name, raising=False)
        try:
            return digest(importlib.import_module("policy").P())
        finally:
            sys.modules.pop("policy", None), sys.modules.pop("other", None)


@pytest.mark.parametrize(
    "text",
    [
        CLASS.format("G"),
        "A = np.array([0.5])\n" + CLASS.format("A[0]"),
        "class Net:\n    def __init__(self, w): self.w = w\nnet = Net(0.5)\n"
        + CLASS.format("net.w"),
        "class Net:\n    def go(self): return net, 0.5\nnet = Net()\n" + CLASS.format("net.go()"),
        "class Net:\n    def go(self): return 0.5\n" + CLASS.format("Net().go()"),
        "def make(g): return lambda: g\nf = make(0.5)\n" + CLASS.format("f()"),
        CLASS.format("(lambda: G)()"),
        CLASS.format("[G * x for x in seen]"),
        CLASS.format("self.g()") + STATIC,
        CLASS.format("self.g") + PROPERTY,
        CLASS.format("self.g") + PROPERTY.replace("property", "functools.cached_property"),
        CLASS.format("self.g()") + STATIC.replace("staticmethod", "functools.lru_cache"),
        CLASS.format("other.V"),
        CLASS.format("far()"),
        CLASS.format("other.Made().go()"),
        CLASS.format("other.made.go()"),
    ],
)
def test_what_is_taken_from_elsewhere_counts(tmp_path: Path, text: str) -> None:
    ours, theirs = HEAD + text, (HEAD + text).replace("0.5", "0.1")
    others = OTHER, OTHER.replace("0.5", "0.1")
    before = of(tmp_path / "a", ours, others[0])
    assert of(tmp_path / "b", ours, others[0]) == before
    assert of(tmp_path / "c", theirs, others[1]) != before


def test_comments_and_layout_do_not_count(tmp_path: Path) -> None:
    text = HEAD + CLASS.format("G")
    told = text.replace("return G", "# as far as it goes\n        return (G)  # half")
    assert of(tmp_path / "a", text, OTHER) == of(tmp_path / "b", told, OTHER)


def test_code_without_a_file_counts_too() -> None:
    """As of a notebook's cell, or what Python reads from its standard input."""

    def written(gain: str) -> str:
        exec(HEAD.partition("import other")[0] + CLASS.format(gain), space := {"__name__": "cell"})
        return digest(space["P"]())

    assert written("0.5") == written("0.5") != written("0.1")
    words = "seen in {'a', 'b', 'c', 'd'}"  # a set has another order in each process
    assert written(words) == written(words)
