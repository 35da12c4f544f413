"""`pytest --sims`: the known simulators, what is here, what each can do and where it deviates."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pytest_simbench.selection import Selection


def list_simulators(selection: Selection) -> Iterator[str]:
    """Lines, a paragraph for each registered simulator."""
    from pytest_simbench.simulator.registry import adapter, registered

    for name in registered():
        cls = adapter(name)
        info = cls.info
        missing = selection.missing(name)
        yield f"{name}: {info.title} ({info.licence}), engine {info.engine}"
        try:
            here = f"version {version(info.distribution)} installed"
        except PackageNotFoundError:
            here = "in an interpreter of its own"
        yield f"    {'NOT HERE: ' + missing if missing else here}, tested {info.tested_version}"
        yield f"    modes: {', '.join(info.modes)}; profiles: {', '.join(cls.profiles)}"
        yield f"    can: {', '.join(sorted(info.capabilities))}"
        for deviation in info.deviations:
            what = f"{deviation.quantity}: " if deviation.quantity else ""
            yield f"    deviates: {what}{deviation.reason}"
        yield ""
