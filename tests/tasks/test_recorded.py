"""What a policy or a task takes from elsewhere is a part of it, and how it is laid out is none."""

from __future__ import annotations

import importlib
import linecache
import os
import subprocess
import sys
from pathlib import Path

import pytest

from pytest_simbench.tasks.recorded import digest, look_anew

HEAD = "import functools\nimport numpy as np\nimport other\nfrom other import far\nG = 0.5\n"
CLASS = "class P:\n    def act(self, seen):\n        return {}\n"
STATIC = "    @staticmethod\n    def g():\n        return G\n"
LOAD = "def load():\n    global made\n    made = made or G\n    return made\n"
CALL = CLASS.format("load()") + LOAD
PROPERTY = "    @property\n    def g(self):\n        return G\n"
OTHER = (
    "V = 0.5\nclass Made:\n    def go(self): return V\ndef far(): return 0.5\nmade = Made()\n"
    "def act(a, b): return far()\n"
)


def of(folder: Path, text: str, other: str) -> str:
    """The digest of the policy that a file makes, beside another file."""
    (folder / "pack").mkdir(parents=True, exist_ok=True)
    (folder / "policy.py").write_text(text)
    (folder / "other.py").write_text(other)
    (folder / "pack" / "inner.py").write_text(other.replace("V", "G"))
    linecache.checkcache()
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        patch.setattr(sys, "dont_write_bytecode", True)
        try:
            return digest(importlib.import_module("policy").P())
        finally:
            for name in ("policy", "other", "pack", "pack.inner"):
                sys.modules.pop(name, None)


@pytest.mark.parametrize(
    "text",
    [
        CLASS.format("G"),
        "def act(seen): return G\nP = lambda: act\n",
        "def near(): return G\ndef act(seen): return near()\nP = lambda: act\n",
        "class Base:\n    def act(self, seen): return G\nclass P(Base): pass\n",
        "R = [{'a': 0.5}]\n" + CLASS.format("R[0]"),
        "A = np.array([0.5])\n" + CLASS.format("A[0]"),
        "class Net: pass\nnet = Net()\nnet.w = 0.5\n" + CLASS.format("net.w"),
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
        "class H(other.Made): pass\n" + CLASS.format("H().go()"),
        "go = other.made.go\n" + CLASS.format("go()"),
        "go = functools.partial(other.act, 1, 2)\n" + CLASS.format("go()"),
        "import pack.inner\n" + CLASS.format("pack.inner.G"),
        "def half(f): return lambda *a: 0.5\n" + CLASS.replace("    d", "    @half\n    d"),
        "class P:\n    def act(self, seen): return G\nact, P = P().act, lambda: act\n",
        "class P:\n    @classmethod\n    def act(cls): return G\nact, P = P.act, lambda: act\n",
    ],
)
def test_what_is_taken_from_elsewhere_counts(tmp_path: Path, text: str) -> None:
    before = of(tmp_path / "a", HEAD + text, OTHER)
    assert of(tmp_path / "b", HEAD + text, OTHER) == before
    theirs, others = (words.replace("0.5", "0.1") for words in (HEAD + text, OTHER))
    assert of(tmp_path / "c", theirs, others) != before


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (CLASS.format("G"), CLASS.format("(G)  # half").replace("class", "# as it was\n\nclass")),
        (f"{CALL}made = None\n", f"{CALL}made = 0.5\n"),  # it is made when it is needed first
    ],
)
def test_what_does_not_count(tmp_path: Path, text: str, told: str) -> None:
    assert of(tmp_path / "a", HEAD + text, OTHER) == of(tmp_path / "b", HEAD + told, OTHER)


def test_another_machine_has_the_files_elsewhere(tmp_path: Path) -> None:
    """Paths count as seen from the code, others as they are."""
    head = "import os, pathlib\nW = pathlib.Path(__file__).parent\nX = os.path.join(W, 'x')\n"
    text = head + "DATA = '/data/weights'\n" + CLASS.format("W, X, DATA, __file__")
    first = of(tmp_path / "a", text, OTHER)
    assert of(tmp_path / "b", text, OTHER) == first
    assert of(tmp_path / "c", text.replace("'x'", "'y'"), OTHER) != first
    assert of(tmp_path / "d", text.replace("/data", "/other"), OTHER) != first


def test_code_without_a_file_counts_too() -> None:
    """As of a notebook's cell, or what Python reads from its standard input."""

    def written(gain: str) -> str:
        exec(HEAD.partition("import other")[0] + CLASS.format(gain), space := {"__name__": "cell"})
        return digest(space["P"]())

    assert written("0.5") == written("0.5") != written("0.1")
    exec(HEAD.partition("import other")[0] + CLASS.format("far()"), space := {"__name__": "cell"})
    space["far"] = lambda: 0.5
    before = digest(space["P"]())
    space["far"] = lambda: 0.1
    look_anew()
    assert digest(space["P"]()) != before


def test_a_set_in_the_code_has_another_order_in_each_process() -> None:
    code = CLASS.replace("{}", "seen in {'a', 'b', 'c', 'd'}") + "print(digest(P()))"
    code = "from pytest_simbench.tasks.recorded import digest\n" + code
    seeds = ({**os.environ, "PYTHONHASHSEED": seed} for seed in "123")
    assert len({subprocess.check_output([sys.executable, "-c", code], env=e) for e in seeds}) == 1
