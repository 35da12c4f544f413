"""The page of a stranger's run: texts stay texts, and nothing is loaded or followed."""

from __future__ import annotations

import re
from collections import Counter
from html.parser import HTMLParser
from pathlib import Path

import pytest

from pytest_simbench.experiment.identity import file_stem_of
from pytest_simbench.records.notes import Notes
from pytest_simbench.records.record import Record
from pytest_simbench.records.repeatability import Line, append
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.model.summary import summarise
from pytest_simbench.report.page import context
from pytest_simbench.report.page.render import render
from tests.hostile import HOSTILE, assert_harmless_terminal
from tests.report.samples import METRICS, failed, record, stacking_run, throwing_run
from tests.report.test_hostile import ALL, declared, records

MORE = (
    "</script><script>alert(1)</script>", "</title><script>alert(1)</script>", "</style>",
    '" onmouseover="alert(1)', "' autofocus onfocus=alert(1) x='", "--><svg onload=alert(1)>",
    "javascript:alert(1)", "logs/../../x.log", "logs/a.log\njavascript:", "{{ 7 * 7 }}",
    "{% raw %}", "]]><x>", "&#106;avascript:alert(1)", "http://evil.example/x.log",
    "//evil.example/x",
)  # fmt: skip
"""What a page might take for its own, besides what other media might."""

LOADING = {
    "action", "archive", "background", "cite", "classid", "codebase", "data", "dynsrc",
    "formaction", "href", "icon", "longdesc", "lowsrc", "manifest", "ping", "poster", "profile",
    "src", "srcdoc", "srcset", "usemap", "xlink:href", "xml:base",
}  # fmt: skip
"""Every attribute of HTML and SVG whose value can be an address (html.spec.whatwg.org, attributes;
w3.org/TR/SVG2, linking; and obsolete ones that browsers still know)."""


class Parsed(HTMLParser):
    """Elements with their attributes, and all text that is seen."""

    def __init__(self, page: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.text: dict[str, str] = {}
        self._open = ""
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        self._open = tag

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)

    def handle_data(self, data: str) -> None:
        self.text[self._open] = self.text.get(self._open, "") + data


def made(found: list[Record], folder: Path, metrics: object = METRICS) -> str:
    summaries = summarise(found, metrics)
    return render(context.page(folder, Report(summaries, found)))


def kinds(page: str) -> set[tuple[str, str]]:
    """Each element with each of its attributes."""
    return {(tag, name) for tag, given in Parsed(page).elements for name in [*given, ""]}


def addresses(page: str) -> list[str]:
    """Every value that a browser might load or follow, in attributes and styles."""
    found = []
    for _, given in Parsed(page).elements:
        found += [value for name, value in given.items() if name in LOADING]
        for value in given.values():
            found += re.findall(r"url\(\s*['\"]?([^'\")]*)", value)
    style = "".join(re.findall(r"<style>(.*?)</style>", page, re.DOTALL))
    return found + re.findall(r"url\(|@import", style)


def harmless(address: str) -> bool:
    """A place on the page, or a log or a video of the run folder."""
    plain = r"#[A-Za-z0-9_-]+|(logs|videos)/[A-Za-z0-9_=-][A-Za-z0-9_.=-]*\.(log|mp4)"
    return bool(re.fullmatch(plain, address))


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A page with everything that a page can have."""
    found = [*stacking_run(), *stacking_run("gui"), *throwing_run(), *records("plain")]
    return made(found, tmp_path_factory.mktemp("run"), METRICS | declared("plain"))


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without matplotlib's pictures, which take seconds each."""
    monkeypatch.setattr(context, "drawn", lambda pictures: ([], ""))


def test_nothing_is_loaded_from_anywhere(plain: str) -> None:
    found = addresses(plain)
    assert len(found) > 5
    assert [address for address in found if not harmless(address)] == []
    (policy,) = [
        given["content"]
        for tag, given in Parsed(plain).elements
        if tag == "meta" and given.get("http-equiv") == "Content-Security-Policy"
    ]
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert not {tag for tag, _ in Parsed(plain).elements} & {
        *("base", "embed", "frame", "iframe", "img", "link", "object", "video", "audio", "source")
    }


@pytest.mark.parametrize("text", [*HOSTILE, *MORE], ids=lambda text: ascii(text)[:20])
@pytest.mark.usefixtures("undrawn")
def test_no_text_becomes_markup(text: str, plain: str, tmp_path: Path) -> None:
    assert_nothing_but_text(text, plain, tmp_path)


@pytest.mark.parametrize("text", ["".join((ALL, *MORE)), "\ud800", "-->", "]]>"], ids=ascii)
def test_no_text_becomes_markup_in_a_picture(text: str, plain: str, tmp_path: Path) -> None:
    assert "<svg" in assert_nothing_but_text(text, plain, tmp_path)


def assert_nothing_but_text(text: str, plain: str, tmp_path: Path) -> str:
    page = made(records(text), tmp_path, declared(text))
    parsed = Parsed(page)
    assert kinds(page) <= kinds(plain)
    assert [address for address in addresses(page) if not harmless(address)] == []
    assert sum(tag == "script" for tag, _ in parsed.elements) == 2
    for _, given in parsed.elements:
        assert not [name for name in given if name.startswith("on")]
        for value in given.values():
            assert_harmless_terminal(value)
    for tag, shown in parsed.text.items():
        if tag not in ("style", "script"):
            assert_harmless_terminal(shown)
    return page


@pytest.mark.usefixtures("undrawn")
def test_texts_are_shown_as_they_are(tmp_path: Path) -> None:
    page = made(records("<b>&amp;'\"|{{x}}"), tmp_path, declared("<b>&amp;'\"|{{x}}"))
    text = Parsed(page).text
    assert "<b>&amp;'\"|{{x}}" in text["b"]
    assert "<b>&amp;'\"|{{x}}" in text["pre"]


def test_results_on_repeatability_stay_texts(tmp_path: Path, plain: str) -> None:
    text = "".join((ALL, *MORE))
    append(
        tmp_path,
        Line("search", text, text, text, text, text, 1, {}, {}, {"sentence": text}),
    )
    page = made([failed("WorkerDied", "load", "gone")], tmp_path)
    assert 'id="repeatability"' in page
    assert kinds(page) <= kinds(plain) | {("section", "id")}


@pytest.mark.parametrize(
    ("log", "linked"),
    [
        ("logs/test_x-1.log", True),
        ("logs/../x.log", False),
        ("logs/.x.log", False),
        ("/logs/x.log", False),
        ("javascript:alert(1)//logs/x.log", False),
        ("logs/x.log\n", False),
        ("logs/x.html", False),
    ],
)
def test_only_a_log_of_the_run_is_a_link(log: str, linked: bool, tmp_path: Path) -> None:
    page = made([failed("WorkerDied", "load", "gone", notes=Notes(log=log))], tmp_path)
    found = [address for address in addresses(page) if not address.startswith("#")]
    assert found == ([log] if linked else [])


@pytest.mark.usefixtures("undrawn")
def test_videos_are_linked_and_their_names_do_no_harm(tmp_path: Path) -> None:
    """With the task, and with the cause of a failure."""
    text = "".join((ALL, *MORE))
    found = [record(text, test=f"t[{text}]"), failed("WorkerDied", "load", "gone"), record("drake")]
    for shown in found[:2]:
        path = tmp_path / "videos" / f"{file_stem_of(shown)}.mp4"
        path.parent.mkdir(exist_ok=True)
        path.touch()
    page = made(found, tmp_path)
    videos = [address for address in addresses(page) if address.startswith("videos/")]
    assert all(map(harmless, videos))
    stems = [file_stem_of(shown) for shown in found]
    assert Counter(videos) == {f"videos/{stems[0]}.mp4": 1, f"videos/{stems[1]}.mp4": 2}
    cause = page[page.index('class="cause"') : page.index("Every repetition")]
    assert f'href="videos/{stems[1]}.mp4"' in cause
