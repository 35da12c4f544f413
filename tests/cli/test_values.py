"""What a user types, in every form: the value that it means, or the sentence that refuses it."""

from __future__ import annotations

from ast import literal_eval
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.cli import values
from pytest_simbench.cli.values import BadValue, Number
from tests.approval import assert_approved

LONG, PATH = "x" * 100, "/".join(["x" * 255] * 16)
"""A name and a path that are as long as they may be."""

TYPED: list[tuple[Callable[[str], Any], list[str]]] = [
    (values.flag, [" Yes ", "1", "OFF", "no", "maybe", ""]),
    (Number(0, 2.5), [" 2.5 ", "+0", ".5e0", "0" * 30, "0" * 31, "-.1", "2.6", "x", "1e999", ""]),
    (Number(1, 12, whole=True), ["12", "1", "13", "0", "1.0"]),
    (lambda text: values.SEED.check(literal_eval(text)), ["7", "1.0", "True", "'1'"]),
    (lambda text: values.SHARE.check(literal_eval(text), "?"), ["1", ".5", "True", "1e999"]),
    (values.repetitions, ["auto", " auto:7", "3", "100000", "100001", "auto:", "auto:x", "3:4"]),
    (values.jobs, [" auto ", "256", "257", "0", "many"]),
    (values.choice("on", "off"), ["on", "ON", "y" * 60, "y" * 61]),
    (values.word, [" a b ", f" {LONG} ", f"{LONG}x", " ", "a\nb"]),
    (values.profiles, ["b, a.toml,b", "b,", ".toml\0.toml"]),
    (values.simulator, [" a ", "a @/b c", "a@", "@b", "a@\n"]),
    (values.simulators, ["a,b", "a,"]),
    (values.file, [PATH, f"{PATH[:-1]}/x", f"{PATH[:-4]}ü/üü", "x" * 256, "", "a\0", "\ud800"]),
    (values.policies, ["a.py , b:c.py,a.py:n", "c.py", "b:c", "a.py,,", ":"]),
    (values.robot, ["ur5", ""]),
    (values.steps, ["1e-3,1, 1e-9,1000", "1,1.00001", "1001", "1e-10", "x", ""]),
    (values.address, ["tcp://a-b.c:1", " TLS://[::1]:65535", "tcp://a:0", "tls://a:65536", "a:1"]),
    (values.releases, ["a-b:2", "a:100:minor", "a:1", "a:101", "a", "a:2:major"]),
    (values.span, ["a:3.2..3.3.1", "a:3..3", "a:3", "a:3..x"]),
    (values.duration, ["90s", "1.5 min", " 2H", ".1s", f"{10**8}s", f"{10**9}s", "0.00s", "5"]),
    (values.words, ["a, b", "a,"]),
    (values.metric, [f" {LONG}", f"{LONG}x", "a-b", ""]),
    (values.limits, ["a:5%, b : .1", "a:5%,b", "a:x"]),
    (values.settings, ["a.b = 1 ,c==3.7.d=x=y", "a", "=1", "a=", "a\0b=1", "a=1\n2", "a=1,b",
                       f"{LONG}={PATH}", f"{LONG}x=1", f"a={PATH}x"]),
    (values.assignment, ["a=b,c=d", "a"]),
    (values.thresholds, ["a=1,b=-.5", "a=1,b=x", "a=1e301", "a"]),
    (lambda text: values.each_once(values.settings(text)), ["a=1,b=2", "a=1,b=2,a=3"]),
]  # fmt: skip


def outcome(read: Callable[[str], Any], text: str) -> str:
    try:
        return f"{values.shown(text)} is {read(text)!r:.120}"
    except BadValue as error:
        error.add_note("a note")
        return f"{error.sentence('--x')} | {' | '.join(error._render_traceback_())}"


def test_every_form(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("os.sched_getaffinity", lambda pid: {0, 1, 3})
    Path("a.py").touch()
    Path("b:c.py").touch()
    assert_approved("values", "\n".join(outcome(read, t) for read, texts in TYPED for t in texts))
