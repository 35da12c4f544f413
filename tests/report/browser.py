"""Pages in a real browser, from file://."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from pytest_simbench.report.page import PAGE_NAME
from pytest_simbench.report.replay import REPLAY_NAME

if TYPE_CHECKING:
    from playwright.sync_api import Browser, ConsoleMessage, Page

BROWSER = shutil.which("chromium")
ARGUMENTS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
"""CI is root in a container, and has no graphics card."""


PLAIN = ["--no-sandbox"]
"""The page is put together without a graphics card too, as in many virtual machines."""


@pytest.fixture(scope="module")
def browser(request: pytest.FixtureRequest) -> Iterator[Browser]:
    """With `ARGUMENTS`, or others by indirect parametrisation."""
    playwright = pytest.importorskip("playwright.sync_api", reason="needs the extra 'test'")
    if BROWSER is None:
        pytest.skip("no chromium here: apt-get install chromium")
    arguments = getattr(request, "param", ARGUMENTS)
    with playwright.sync_playwright() as started:
        found = started.chromium.launch(executable_path=BROWSER, args=arguments)
        yield found
        found.close()


class Opened:
    """Pages of one test; at the end nothing may have been complained of or loaded."""

    def __init__(self, browser: Browser) -> None:
        self._browser = browser
        self._contexts: list[Any] = []
        self.complaints: list[str] = []
        self.loaded: list[str] = []

    def __call__(
        self, path: Path, width: int = 1400, height: int = 900, fragment: str = "", **given: Any
    ) -> Page:
        context = self._browser.new_context(viewport={"width": width, "height": height}, **given)
        context.set_default_timeout(60_000)
        self._contexts.append(context)
        page: Page = context.new_page()
        page.on("console", self._said)
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("dialog", lambda dialog: self.complaints.append(dialog.message))
        page.on("request", lambda request: self.loaded.append(request.url))
        page.goto(path.as_uri() + fragment)
        return page

    def _said(self, message: ConsoleMessage) -> None:
        if not message.text.startswith("[.WebGL-"):  # the driver's advice on speed
            self.complaints.append(message.text)

    def close(self) -> None:
        for context in self._contexts:
            context.close()


@pytest.fixture
def opened(browser: Browser) -> Iterator[Opened]:
    found = Opened(browser)
    yield found
    found.close()
    assert found.complaints == []
    loaded = [url for url in found.loaded if not url.startswith("data:")]
    assert loaded
    assert {url.partition("#")[0].rpartition("/")[2] for url in loaded} <= {PAGE_NAME, REPLAY_NAME}
