"""An engine with a regression planted in it: MuJoCo, whose world stands still from release 1.3 on.

Its adapter is a copy of MuJoCo's that asks the release which it is. The releases are packages of a
few lines on the path of a wrapper, so that nothing is installed.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from tests.plugin.inner import FALLING, distribution, importable

ADAPTER = """
from dataclasses import replace

from pytest_simbench.simulator import lazy_import
from pytest_simbench.sims.mujoco.adapter import MuJoCo

planted = lazy_import("planted_engine")


class Planted(MuJoCo):
    info = replace(
        MuJoCo.info, name="planted", title="Planted", distribution="planted-engine",
        modules=("planted_engine",), tested_version="1.5", oldest_version="1.0",
    )

    def step(self):
        if planted.BROKEN and self.data.time > 0.05:
            self.data.time += self.model.opt.timestep
        else:
            super().step()
"""

RELEASES = ("1.0", "1.1", "1.2", "1.3", "1.4", "1.5")


def plant(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Make adapter, test, environments and a package index, for inner runs; returns the page of the
    index."""
    folder, environments = pytester.path, pytester.path / "environments"
    site, index = folder / "site", folder / "index" / "planted-engine"
    (folder / "test_planted.py").write_text(FALLING)
    distribution(site, "planted-adapter", "planted = planted_adapter:Planted", ADAPTER)
    index.mkdir(parents=True)
    offer(index / "index.html", *RELEASES)
    for version in RELEASES:
        _environment(environments / f"planted=={version}", version)
    monkeypatch.setenv("SIMBENCH_ENVIRONMENTS", str(environments))
    monkeypatch.setenv("PIP_INDEX_URL", index.parent.as_uri())
    monkeypatch.setenv("PIP_EXTRA_INDEX_URL", (folder / "none").as_uri())
    importable(monkeypatch, site)
    return index / "index.html"


def offer(index: Path, *versions: str) -> None:
    """Have the index hold these releases alone."""
    names = [f"planted_engine-{version}-py3-none-any.whl" for version in versions]
    index.write_text("".join(f'<a href="{n}">{n}</a>\n' for n in names))


def _environment(folder: Path, version: str) -> None:
    packages = folder / "lib" / "python3" / "site-packages"
    info = packages / f"planted_engine-{version}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: planted-engine\nVersion: {version}\n"
    )
    broken = float(version) >= 1.3
    (packages / "planted_engine.py").write_text(f"BROKEN = {broken}\n")
    python = folder / "bin" / "python"
    python.parent.mkdir()
    python.write_text(f'#!/bin/sh\nPYTHONPATH="{packages}" exec "{sys.executable}" "$@"\n')
    python.chmod(0o755)
    told = {"requirements": [f"planted-engine=={version}", "numpy"]}
    (folder / "simbench.json").write_text(json.dumps(told))
