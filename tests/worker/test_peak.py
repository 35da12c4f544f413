"""The exact memory peak of a worker, in MB of a million bytes."""

from __future__ import annotations

import subprocess
import sys

import pytest

from pytest_simbench.worker.server import peak_rss_mb, reset_peak_rss

CODE = """
from pytest_simbench.worker.server import peak_rss_mb, reset_peak_rss

def kilobytes(key):
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith(key))

block = bytearray(b"x") * 100_000_000
peak, before = peak_rss_mb(), kilobytes("VmHWM")
del block
reset_peak_rss()
print(peak, before, peak_rss_mb(), kilobytes("VmRSS"))
"""


def test_the_peak_is_the_kernel_s_and_starts_anew() -> None:
    found = subprocess.run(
        [sys.executable, "-c", CODE], capture_output=True, text=True, check=True
    ).stdout.split()
    peak, kilobytes, after, now = map(float, found)
    assert peak == pytest.approx(kilobytes * 1024 / 1e6, rel=3e-4)  # not MiB: 4.9 % less
    assert peak > 100
    assert after < peak - 90
    assert after == pytest.approx(now * 1024 / 1e6, rel=0.05)


def test_where_the_kernel_tells_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*args: object, **options: object) -> None:
        raise PermissionError("no /proc here")

    monkeypatch.setattr("builtins.open", refused)
    assert peak_rss_mb() is None
    reset_peak_rss()
