"""What a user types, in every form: the value that it means, or the sentence that refuses it."""

from __future__ import annotations

from ast import literal_eval
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.cli import values
from pytest_simbench.cli.values import Auto, BadValue, Number, Releases, Span
from tests.approval import assert_approved

LONG, PATH = "x" * 100, "/".join(["x" * 255] * 16)
"""A name and a path that are as long as they may be."""

READ: list[tuple[Callable[[str], Any], dict[str, Any], tuple[str, ...]]] = [
    (values.flag, {" Yes ": True, "1": True, "OFF": False, "no": False}, ("maybe", "")),
    (Number(0, 2.5), {" 2.5 ": 2.5, "+0": 0, ".5e0": 0.5, "0" * 30: 0},
     ("-.1", "2.6", "x", "1e999", "0" * 31, "1e", "")),
    (Number(1, 12, whole=True), {"12": 12, "1": 1}, ("13", "0", "1.0")),
    (lambda text: values.SEED.check(literal_eval(text)), {"7": 7}, ("1.0", "True", "'1'")),
    (lambda text: values.SHARE.check(literal_eval(text), text), {"1": 1, ".5": 0.5},
     ("True", "1e999", "None")),
    (values.repetitions, {"auto": Auto(160), " auto:7": Auto(7), "3": 3, "100000": 100_000},
     ("auto:", "auto:x", "0", "100001", "3:4")),
    (values.jobs, {" auto ": 3, "256": 256}, ("0", "257", "many")),
    (values.choice("on", "off"), {"on": "on"}, ("ON", "y" * 60, "y" * 61)),
    (values.word, {" a b ": "a b", f" {LONG} ": LONG}, (" ", f"{LONG}x", "a\nb")),
    (values.profiles, {"b, a.toml,b": ("b", "a.toml")}, ("b,", ".toml\0.toml")),
    (values.simulator, {" a ": "a", "a @/b c": "a@/b c"}, ("a@", "@b", "a@\n")),
    (values.simulators, {"a,b": ["a", "b"]}, ("a,",)),
    (values.file, {PATH: PATH},
     ("", "a\0", "\ud800", f"{PATH[:-1]}/x", "x" * 256, f"{PATH[:-4]}ü/üü")),
    (values.policies, {"a.py , b:c.py,a.py:n": [("a.py", ""), ("b:c.py", ""), ("a.py", "n")]},
     ("c.py", "b:c", "a.py,,", ":")),
    (values.robot, {"ur5": "ur5"}, ("",)),
    (values.steps, {"1e-3,1, 1e-9,1000": (1000, 1, 1e-3, 1e-9)},
     ("1,1.00001", "1001", "1e-10", "x", "")),
    (values.address, {"tcp://a-b.c:1": "tcp://a-b.c:1", " TLS://[::1]:65535": "TLS://[::1]:65535"},
     ("tcp://a:0", "tls://a:65536", "udp://a:1", "tcp://a")),
    (values.releases, {"a-b:2": Releases("a-b", 2, False), "a:100:minor": Releases("a", 100, True)},
     ("a:1", "a:101", "a", "a:2:major")),
    (values.span, {"a:3.2..3.3.1": Span("a", "3.2", "3.3.1")}, ("a:3..3", "a:3", "a:3..x")),
    (values.duration, {"90s": 90, "1.5 min": 90, " 2H": 7200, ".1s": 0.1, f"{10**8}s": 1e8},
     ("0s", "0.00s", "5", f"{10**9}s")),
    (values.words, {"a, b": ["a", "b"]}, ("a,",)),
    (values.metric, {f" {LONG}": LONG}, (f"{LONG}x", "a-b", "")),
    (values.limits, {"a:5%, b : .1": "a:5%, b : .1"}, ("a:5%,b", "a:x")),
    (values.settings, {"a.b = 1 ,c==3.7.d=x=y": [("a.b", "1"), ("c==3.7.d", "x=y")],
                       f"{LONG}={PATH}": [(LONG, PATH)]},
     ("a", "=1", "a=", "a\0b=1", f"{LONG}x=1", f"a={PATH}x", "a=1\n2", "a=1,b")),
    (values.assignment, {"a=b,c=d": [("a", "b,c=d")]}, ("a",)),
    (values.thresholds, {"a=1,b=-.5": [("a", 1), ("b", -0.5)]}, ("a=1,b=x", "a=1e301", "a")),
    (lambda text: values.each_once(values.settings(text)), {"a=1,b=2": {"a": "1", "b": "2"}},
     ("a=1,b=2,a=3",)),
]  # fmt: skip
"""Each form with texts that it takes, and such that it refuses."""


def refusal(read: Callable[[str], Any], text: str) -> str:
    try:
        return f"taken: {read(text)!r}"
    except BadValue as error:
        return error.sentence("--x")


def test_every_form(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("os.sched_getaffinity", lambda pid: {0, 1, 3})
    Path("a.py").touch()
    Path("b:c.py").touch()
    assert [{text: read(text) for text in fine} for read, fine, _ in READ] == [
        fine for _, fine, _ in READ
    ]
    noted = BadValue("", "give\x1b")
    noted.add_note("why")
    assert noted._render_traceback_() == [r"give\x1b", "why"]
    told = [refusal(read, text) for read, _, wrong in READ for text in wrong]
    assert_approved("values", "\n".join(told))
