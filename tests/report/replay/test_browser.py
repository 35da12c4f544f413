"""The replay in a real browser, from file://: it plays, and shows what the traces say."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from matplotlib.image import imread

from pytest_simbench.client.motion import Motion
from pytest_simbench.experiment.identity import file_stem_of
from pytest_simbench.recordings.trace import Trace
from pytest_simbench.records.record import Record
from pytest_simbench.report.files import write_files
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.model.summary import summarise
from pytest_simbench.report.replay.recorded import groups
from pytest_simbench.report.replay.render import replay_of
from pytest_simbench.scene import Pose
from tests.recordings.samples import motion, scene
from tests.report.browser import PLAIN, Opened, browser, opened
from tests.report.page.test_browser import SIZES, STRANGE
from tests.report.samples import METRICS, record

if TYPE_CHECKING:
    from playwright.sync_api import Page

__all__ = ["browser", "opened"]  # fixtures


def longer(seconds: float) -> Motion:
    """The sample's motion, slowed down to so many seconds; the red cube falls meanwhile."""
    found = motion()
    bodies = found.bodies.copy()
    bodies[:, 0, 2] = np.linspace(0.6, 0.2, len(bodies))
    return Motion(np.linspace(0.02, seconds, len(bodies)), found.joints, bodies)


def write(folder: Path, kept: list[tuple[Record, Trace]]) -> Path:
    """A replay of such repetitions."""
    for made, trace in kept:
        trace.write(folder, f"traces/{file_stem_of(made)}.npz")
    page, count, problems = replay_of(groups(folder, [made for made, _ in kept]))
    assert count
    assert problems == []
    path = folder / "replay.html"
    path.write_text(page, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def replay(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two seeds: one of two simulators, of which one ends earlier, the other of one that failed."""
    phases = [(0.0, "pick"), (1.0, "place")]
    kept = [
        (record("mujoco"), Trace.of(scene(), longer(2.0), phases)),
        (record("drake"), Trace.of(scene(), longer(1.0), phases)),
        (record("mujoco", 2, status="failed"), Trace.of(scene(), longer(0.5), phases)),
    ]
    return write(tmp_path_factory.mktemp("run"), kept)


def show(opened: Opened, path: Path, *where: Any, **how: Any) -> Page:
    page = opened(path, *where, **how)
    page.wait_for_selector("body[data-ready]")
    return page


def frame(page: Page) -> bytes:
    """What is on the screen now."""
    return page.screenshot(clip={"x": 0, "y": 60, "width": 400, "height": 500})


def go(page: Page, time: float) -> None:
    page.locator("#time").evaluate(
        "(slider, time) => { slider.value = time; slider.dispatchEvent(new Event('input')); }", time
    )


def until(page: Page, condition: str) -> None:
    """Wait for it; Playwright's own way is one of those that the page's policy forbids."""
    for _ in range(200):
        if page.evaluate(condition):
            return
        page.wait_for_timeout(50)
    pytest.fail(f"never: {condition}")


def stands_still(page: Page) -> None:
    """Wait until nothing is drawn any more; frames that were on their way may still come."""
    for _ in range(20):
        drawn = page.locator("canvas").get_attribute("data-frames")
        page.wait_for_timeout(200)
        if page.locator("canvas").get_attribute("data-frames") == drawn:
            return
    pytest.fail("it goes on drawing")


def lines(page: Page) -> list[str]:
    return [" ".join(text.split()) for text in page.locator(".tile").all_inner_texts()]


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize(("width", "height"), SIZES)
def test_it_opens_fits_and_plays(
    replay: Path, opened: Opened, width: int, height: int, scheme: str
) -> None:
    page = show(opened, replay, width, height, color_scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate("document.documentElement.scrollHeight") <= height
    assert lines(page) == ["mujoco pick", "drake pick"]
    before = frame(page)
    page.locator("#speed").select_option("0.1")  # however slow the machine is, it will not end
    page.get_by_role("button", name="Play").click()
    until(page, "Number(document.getElementById('time').value) > 0.2")
    assert any(frame(page) != before for _ in range(10))  # what is drawn is seen a moment later
    page.get_by_role("button", name="Pause").click()
    stands_still(page)
    assert page.evaluate("Number(document.getElementById('time').value)") < 1.9  # the end is 2.0


def test_what_moves_is_in_sight(tmp_path: Path, opened: Opened) -> None:
    """In narrow tiles too, and where a body is nearer than the middle of all."""
    far = longer(1.0)
    far.bodies[:, 0, :3] = 6.0, 0.0, 0.05
    kept = [(record(name), Trace.of(scene(), far, [])) for name in ("mujoco", "drake")]
    page = show(opened, write(tmp_path, kept), 1200, 800)
    box = "new THREE.Box3().setFromObject(scene.getObjectByName('body 0'))"
    side = page.evaluate(f"Math.max(...[{box}.min, {box}.max].map((p) => p.project(camera).x))")
    assert 0.9 < side < 1.0  # 1 is the edge


def test_it_ends_by_itself_and_begins_anew(replay: Path, opened: Opened) -> None:
    page = show(opened, replay)
    page.locator("#speed").select_option("20")
    page.get_by_role("button", name="Play").click()
    until(page, "document.getElementById('play').textContent === 'Play'")
    assert page.locator("#now").inner_text() == "2.00 / 2.00 s"
    assert lines(page) == ["mujoco place", "drake ended at 1.00 s"]
    page.locator("#speed").select_option("0.1")
    page.keyboard.press("Escape")
    page.get_by_role("button", name="Play").click()
    until(page, "Number(document.getElementById('time').value) < 1.9")


def test_what_is_drawn_follows_the_slider_and_the_ghost(replay: Path, opened: Opened) -> None:
    page = show(opened, replay)
    start = frame(page)
    go(page, 1.0)
    later = frame(page)
    assert later != start
    page.locator("#ghost").select_option("drake")
    assert frame(page) != later  # it is seen in the other tile
    page.locator("#ghost").select_option("none")
    assert frame(page) == later
    go(page, 0.0)
    assert frame(page) == start


def test_an_address_leads_to_a_seed(replay: Path, opened: Opened) -> None:
    page = show(opened, replay, fragment="#1")
    assert lines(page) == ["mujoco failed · pick"]
    page.locator("#group").select_option("stacking, seed 1001")
    until(page, "document.querySelectorAll('.tile').length === 2")
    page = show(opened, replay, fragment="#nonsense")
    assert len(lines(page)) == 2


def test_links_and_cubes_are_where_the_trace_has_them(replay: Path, opened: Opened) -> None:
    """The player's own forward kinematics against Python's."""
    page = show(opened, replay)
    kept = Trace.of(scene(), longer(2.0), [])
    names = [*kept.figure.links[1:], "body 0", "body 1"]
    expected = np.concatenate([kept.links()[:, 1:], kept.bodies[:, :, :7]], axis=1)
    for k in (0, 5, 11):
        go(page, float(kept.time[k]))
        found = page.evaluate(
            """(names) => {
              const root = scene.getObjectByName("tile");
              root.updateMatrixWorld(true);
              return names.map((name) => root.getObjectByName(name).matrixWorld.toArray());
            }""",
            names,
        )
        for matrix, pose in zip(found, expected[k], strict=True):
            there = np.reshape(matrix, (4, 4)).T  # three.js keeps columns
            there[:3, :3] /= np.linalg.norm(there[:3, :3], axis=0)  # a cube's size
            np.testing.assert_allclose(there, Pose.from_array(pose).matrix(), atol=1e-3)
    height = """(name) => new THREE.Box3().setFromObject(
      scene.getObjectByName("tile").getObjectByName(name)).getSize(new THREE.Vector3()).z"""
    assert page.evaluate(height, "body 3") == pytest.approx(0.1, abs=1e-3)  # three solids
    assert page.evaluate(height, "body 4") == pytest.approx(0.04, abs=1e-3)  # a mesh


def test_hostile_names_stay_text(tmp_path: Path, opened: Opened) -> None:
    strange = record(STRANGE, test=STRANGE)
    trace = Trace.of(scene(), longer(0.5), [(0.0, STRANGE)])
    page = show(opened, write(tmp_path, [(strange, trace)]))
    assert page.locator(".tile").count() == 1
    assert page.locator(".tile script, .tile img, .tile a").count() == 0
    assert page.evaluate("document.querySelectorAll('script').length") == 3


def test_a_dot_of_the_report_leads_to_its_replay(tmp_path: Path, opened: Opened) -> None:
    kept = [record("mujoco", k, metrics={"placed": k / 4}) for k in (1, 2)]
    Trace.of(scene(), longer(0.5), [(0.0, "task")]).write(
        tmp_path, f"traces/{file_stem_of(kept[1])}.npz"
    )
    assert write_files(tmp_path, Report(summarise(kept, METRICS), kept), figures=False).complete
    page = opened(tmp_path / "report.html")
    dots = page.locator(".strip").first.locator(".dot")
    dots.nth(0).click()
    assert page.locator("#detail a", has_text="replay").count() == 0
    dots.nth(1).click()
    page.locator("#detail a", has_text="replay").click()
    page.wait_for_selector("body[data-ready]")
    assert lines(page) == ["mujoco task"]
    page.get_by_role("link", name="to the report").click()
    assert page.locator(".answer").count()


@pytest.mark.parametrize("browser", [PLAIN], indirect=True, ids=["plain"])
def test_no_tile_is_hidden_without_a_graphics_card(opened: Opened, replay: Path) -> None:
    """Both simulators stand alike in the beginning, so both tiles look alike: Chromium once cut off
    the first one."""
    page = show(opened, replay, 400, 800)
    page.wait_for_timeout(500)
    screen = imread(BytesIO(page.screenshot()), "png")[:, :, :3]
    first, second = (
        screen[int(box["y"]) + 60 : int(box["y"] + box["height"]) - 2]  # below the names
        for tile in page.locator(".tile").all()
        if (box := tile.bounding_box()) is not None
    )
    rows = min(len(first), len(second))
    assert np.abs(first[:rows] - second[:rows]).mean() < 0.02
    assert first.std() > 0.05
