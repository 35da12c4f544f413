"""What tests read of the user's: scenes (`--sim-scene`, `scene_file`) and measured data sets
(`--sim-data`, `data_set`)."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from pytest_simbench.cli.values import refusing
from pytest_simbench.ground.text import for_terminal
from pytest_simbench.plugin import options
from pytest_simbench.plugin.arguments import failing

if TYPE_CHECKING:
    from pytest_simbench.scene import Scene, Start
    from pytest_simbench.tasks import Log

KEYFRAMES = "keyframes"
"""In place of a file of starts: those that the scene's file holds."""


def run_suite(config: pytest.Config) -> None:
    """Where `--sim-scene` stands alone on the command line, collect the suite of scenes."""
    if config.args_source is config.ArgsSource.ARGS or not options.given(config, "sim_scene"):
        return
    spec = find_spec("pytest_simbench.suites")
    if spec is not None and spec.submodule_search_locations:
        config.args = [str(Path(spec.submodule_search_locations[0]) / "test_scene.py")]


def check(config: pytest.Config) -> None:
    """Complain of a scene that cannot be read, and of a folder of data sets that somebody named and
    that is not there: else its tests are skipped.

    Raises:
        pytest.UsageError: one sentence.
    """
    if options.given(config, "sim_data") and not (given := _data_folder(config)).is_dir():
        raise pytest.UsageError(
            f"--sim-data: {for_terminal(str(given))} is no folder; name the one that holds the "
            "data sets, or bring them there with simbench download NAME --data DIR"
        )
    if options.given(config, "sim_scene"):
        from pytest_simbench.experiment.scene_file import read_scene_file
        from pytest_simbench.simulator import SimulatorError

        with options.refusing(SimulatorError, "--sim-scene"):
            scene = read_scene_file(options.value(config, "sim_scene")).scene
        alone = config.args_source is not config.ArgsSource.ARGS  # not for tests of the user's
        if alone and scene.robot is None and not scene.free_bodies:
            raise pytest.UsageError(f"--sim-scene: nothing in {scene.name!r} can move; free a body")


def _data_folder(config: pytest.Config) -> Path:
    """Where data sets are looked for and brought to."""
    from pytest_simbench.data.sets import default_folder

    given = options.value(config, "sim_data")
    return Path(given) if given else default_folder()


def read_or_skip(config: pytest.Config, name: str) -> Any:
    """A data set; without it the test is skipped, with a broken one or a wrong name it fails."""
    from pytest_simbench.data import DataError, DataMissing, read

    with failing(DataError), refusing(DataMissing, kind=pytest.skip.Exception):
        return read(name, _data_folder(config))


@dataclass(frozen=True)
class SceneFiles:
    """The fixture `scene_file`; what is wrong with a file ends the run.

    Attributes:
        request: of the test, whose folder paths are relative to.
        folder: of the run.
        tell: prints what a user should know, at the end of the run.
    """

    request: pytest.FixtureRequest
    folder: Path
    tell: Callable[..., None]

    def log(self, path: str | Path, scene: Scene) -> Log:
        """The log of a file that drives of a scene follow, see `recordings.logs`."""
        from pytest_simbench.recordings.logs import beyond, read_log

        with _ending(self.request.config):
            found = read_log(self.request.path.parent / path, scene)
        for line in beyond(found, scene):
            self.tell(f"{path}: {line}")
        return found

    def __call__(self, path: str | Path | None = None, starts: str | Path | None = None) -> Scene:
        """The scene of a file, and its account in the run folder.

        Without a file the test is skipped: the suite of scenes stands among others.

        Args:
            path: of the scene; None for that of `--sim-scene`.
            starts: of a file of starts (.npz), see `description.starts`, or `KEYFRAMES`; None: the
                scene starts as it is written.
        """
        from pytest_simbench.description.carried import PAGE, keep, terminal_lines
        from pytest_simbench.description.starts import distinct, read_starts
        from pytest_simbench.experiment.scene_file import read_scene_file
        from pytest_simbench.scene import SceneError

        given = options.value(self.request.config, "sim_scene")
        if path is None and not given:
            pytest.skip("this test takes the scene of --sim-scene FILE, and none was named")
        at = Path(given) if path is None else self.request.path.parent / path
        with _ending(self.request.config):
            found = read_scene_file(at)
            scene = found.scene
            rows: tuple[Start, ...] = ()
            if starts == KEYFRAMES:
                rows = scene.starts
                if not rows:
                    raise SceneError(f"{at} has no keyframes; name a file of starts, or none")
            elif starts is not None:
                rows = read_starts(self.request.path.parent / starts, scene)
            scene = replace(scene, starts=rows)
            if (different := distinct(rows, scene)) < len(rows):
                self.tell(
                    f"{starts}: {len(rows)} starts, and {different} different in how the bodies "
                    f"lie to each other: as evidence they count as {different}"
                )
        title = at.name
        try:
            title = keep(self.folder, at, found.account)
        except OSError as error:
            lost = f"{self.folder / PAGE} could not be written ({error.strerror or error})"
            self.tell(lost, unwritten=True)
        for line in terminal_lines(found.account):
            self.tell(f"{title}: {line} ({PAGE})")
        return scene


def _ending(config: pytest.Config) -> AbstractContextManager[None]:
    """A file that cannot be used ends the run with one sentence; in an xdist worker, whose end
    would be an internal error, it fails the test."""
    from pytest_simbench.scene import SceneError
    from pytest_simbench.simulator import SimulatorError

    ends: Callable[[str], BaseException]
    ends = partial(pytest.exit.Exception, returncode=pytest.ExitCode.USAGE_ERROR)
    if hasattr(config, "workerinput"):
        ends = partial(pytest.fail.Exception, pytrace=False)
    return refusing((SimulatorError, SceneError), kind=ends)
