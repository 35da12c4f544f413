"""Interpreters of engines that cannot share ours: made, or the system's; which releases exist."""

from __future__ import annotations

import base64
import io
import json
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.request import Request

import pytest
from pytest_simbench.sims.mujoco.adapter import MuJoCo

from pytest_simbench.client import environments, package_index
from pytest_simbench.client.environments import (
    MARKER,
    Environment,
    create_all,
    existing,
    interpreter,
    missing,
    outside,
    remove,
)
from pytest_simbench.client.package_index import (
    PackageIndexError,
    nearest,
    newest_of_minors,
    releases,
    unreleased,
)
from pytest_simbench.client.system import SystemPython
from pytest_simbench.ground.errors import SimulatorError
from pytest_simbench.simulator import SimulatorInfo
from pytest_simbench.simulator.registry import adapter
from tests.approval import assert_approved_line


@pytest.fixture
def info(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[SimulatorInfo]:
    """A simulator whose engine is the package `six`."""
    monkeypatch.setenv("SIMBENCH_ENVIRONMENTS", str(tmp_path / "environments"))
    return replace(
        MuJoCo.info,
        name="sixth",
        distribution="six",
        modules=("no_such_module_here",),
        requirements=("six==1.16.0",),
        install="simbench install sixth",
        caches={"SIXTH_CACHE": "kernels"},
    )


def half_made(info: SimulatorInfo) -> Environment:
    environment = Environment.of(info)
    environment.python.parent.mkdir(parents=True)
    environment.python.touch()
    environment.folder.with_name(f".{info.name}.lock").touch()
    return environment


@pytest.mark.engine
def test_create(info: SimulatorInfo) -> None:
    environment = Environment.of(info)
    assert environment.problem is not None
    assert interpreter(info) is None
    environment.create()
    assert environment.problem is None
    assert missing(info) is None
    assert environment.version() == "1.16.0"
    assert interpreter(info) == str(environment.python)
    environment.create()  # over an old one
    assert environment.problem is None


@pytest.mark.parametrize("program", ["/bin/uv", None])
def test_what_makes_one(
    info: SimulatorInfo, program: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With uv, which is told of pip's index, or with pip; what was there is lost."""
    environment, ran, told = half_made(info), [], []
    folder, python = environment.folder, str(environment.python)

    def run(command: list[str], variables: dict[str, str], look: Any) -> None:
        ran.append((" ".join(command), variables))
        folder.mkdir(exist_ok=True)
        look()

    monkeypatch.setattr(environments, "uv", lambda: program)
    monkeypatch.setattr(environments, "_run", run)
    monkeypatch.setattr(package_index, "pip_configuration", lambda: {"index-url": "a"})
    environment.create(told.append)
    here, pip = sys.executable, "-m pip install --quiet --disable-pip-version-check"
    uv = f"/bin/uv pip install --quiet --python {python} --index-strategy unsafe-best-match"
    commands = [f"{here} -P -m venv {folder}", f"{python} -P {pip} six==1.16.0"]
    if program:
        commands = [f"/bin/uv venv --quiet --python {here} {folder}", f"{uv} six==1.16.0"]
    assert ran == [(command, {"UV_DEFAULT_INDEX": "a"} if program else {}) for command in commands]
    assert {one.name: one.read_text() for one in folder.iterdir()} == {
        MARKER: '{"requirements": ["six==1.16.0"]}\n'
    }
    assert told == [*["\rsixth: 0 MB, 0 s "] * 2, "\rsixth: 0 MB, 0 s \n"]


def test_two_that_make_the_same_wait_for_each_other(info: SimulatorInfo) -> None:
    """The second one finds it made, and says meanwhile what it waits for."""
    environment, told = Environment.of(info), []
    with ThreadPoolExecutor() as pool, environments.alone(environment.folder, told.append):
        second = pool.submit(environment.create, told.append)
        while not told:
            assert not second.done()
        half_made(info)
        (environment.folder / MARKER).write_text(json.dumps({"requirements": ["six==1.16.0"]}))
        assert environment.problem is None
    # flock belongs to an open file, so that a thread waits as another process would
    assert told == ["another run is making the environment sixth; waiting for it\n"]
    second.result()
    assert environment.python.stat().st_size == 0  # nobody made it anew


def test_what_is_there_and_removing_it(info: SimulatorInfo) -> None:
    assert list(existing()) == []
    environment = half_made(replace(info, distribution="Six-th"))
    (environment.folder / "large").write_bytes(bytes(3_000_000))
    assert environments.size_mb(environment.folder) == pytest.approx(3.0, abs=0.1)
    for name, version in (("sixty", "1.0"), ("Six_Th", "1.2"), ("six-th", "2.0")):
        told = environment.folder / f"lib/python3.9/site-packages/{name}-{version}.dist-info"
        assert environment.version() == ("1.2" if version == "2.0" else None)
        told.mkdir(parents=True)
        (told / "METADATA").write_text(f"Name: {name}\nVersion: {version}\n")
    with environments.alone(environment.folder, print):
        assert list(existing()) == [environment.folder]
    remove(environment.folder)
    assert list(existing()) == []


@pytest.mark.parametrize("kind", ["link", "dangling link", "file", "folder"])
def test_what_else_is_in_its_place_is_left_alone(
    info: SimulatorInfo, tmp_path: Path, kind: str
) -> None:
    environment, elsewhere = Environment.of(info), tmp_path / "elsewhere"
    environment.folder.parent.mkdir(exist_ok=True)
    if kind == "file":
        environment.folder.touch()
    elif kind == "folder":  # somebody's clone of an engine, or an environment of their own
        half_made(info).folder.with_name(".sixth.lock").unlink()
    else:
        environment.folder.symlink_to(elsewhere)
    if kind == "link":
        elsewhere.mkdir()
        (elsewhere / MARKER).write_text("mine")
    for act in (environment.create, lambda: remove(environment.folder)):
        with pytest.raises(SimulatorError, match="is a link|is no environment of ours"):
            act()
    assert environment.folder.is_symlink() == ("link" in kind)
    assert environment.python.exists() == (kind == "folder")
    assert kind != "link" or (elsewhere / MARKER).read_text() == "mine"


def test_nothing_is_made_while_something_is_wrong_with_another(info: SimulatorInfo) -> None:
    wrong = replace(info, name="wrong", requirements=())
    with pytest.raises(SimulatorError, match="wrong needs no environment of its own"):
        create_all([Environment.of(info), Environment.of(wrong)], print)
    assert list(existing()) == []


def test_an_engine_that_is_importable_here_needs_no_environment(info: SimulatorInfo) -> None:
    assert missing(replace(info, modules=("json",))) is None
    assert missing(replace(info, requirements=())) == (
        f"sixth is not installed (no module {ABSENT}); install it: simbench install sixth"
    )


def test_a_release_that_is_none_is_told_before_anything_is_made(
    info: SimulatorInfo, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(package_index, "releases", {"mujoco": ["3.3.7"]}.__getitem__)
    Environment.of(adapter("mujoco==3.3.7").info).check()
    with pytest.raises(SimulatorError, match="^mujoco==3.3.9: the package index has no mujoco 3.3"):
        Environment.of(adapter("mujoco==3.3.9").info).create()
    assert list(existing()) == []


def test_a_folder_that_takes_none_is_one_sentence(info: SimulatorInfo, tmp_path: Path) -> None:
    (tmp_path / "environments").touch()
    with pytest.raises(SimulatorError, match="environments cannot be made in .*exists"):
        Environment.of(info).create()


@pytest.mark.engine
def test_a_release_lives_in_its_own_even_where_the_engine_is_installed_here(
    info: SimulatorInfo,
) -> None:
    release = adapter("mujoco==3.3.7").info
    assert "not there yet: simbench install mujoco==3.3.7" in str(missing(release))
    assert Environment.of(release).folder.name == "mujoco==3.3.7"
    assert missing(adapter("mujoco").info) is None


def test_uv_is_taken_from_beside_the_interpreter_or_else_from_the_path(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    places = [tmp_path / name / "uv" for name in ("beside", "path")]
    monkeypatch.setattr(sys, "executable", str(places[0].with_name("python")))
    monkeypatch.setenv("PATH", str(places[1].parent))
    found = [environments.uv()]
    for place in reversed(places):
        place.parent.mkdir()
        place.touch(0o755)
        found.append(environments.uv())
    assert found == [None, str(places[1]), str(places[0])]


def test_what_pip_is_configured_with(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """What concerns other commands is none of it; a variable is as it is, quotes and all."""
    config = tmp_path / "pip.conf"
    config.write_text("[global]\nindex-url = a\n[install]\nretries = 3\n[list]\nformat = c\n")
    monkeypatch.setenv("PIP_CONFIG_FILE", str(config))
    monkeypatch.setenv("PIP_INDEX_URL", "mine")
    monkeypatch.setenv("PIP_EXTRA_INDEX_URL", 'it\'s "d"')
    found = package_index.pip_configuration()
    told = [found.get(n) for n in ("index-url", "extra-index-url", "retries", "format")]
    assert told == ["mine", 'it\'s "d"', "3", None]
    monkeypatch.delenv("PIP_INDEX_URL")
    assert package_index.pip_configuration()["index-url"] == "a"
    monkeypatch.delenv("PIP_EXTRA_INDEX_URL")
    config.write_text("[global]\nextra-index-url =\n    https://b\n    https://c\n")
    assert package_index._indexes()[1:] == ["https://b", "https://c"]
    config.write_text("[global]\nno-index = false\n")
    assert package_index._indexes() == [package_index.PYPI]
    config.write_text("[global]\nno-index = True\n")
    assert package_index._indexes() == []


def test_pips_configuration_is_uvs_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("UV_INDEX", "mine")
    told = {"index-url": "a", "extra-index-url": "b c", "find-links": "d e", "timeout": "9"}
    assert environments._as_uv(told) == {"UV_DEFAULT_INDEX": "a", "UV_FIND_LINKS": "d,e"}


@pytest.mark.engine
def test_one_that_does_not_install_stays_half_made(info: SimulatorInfo) -> None:
    info = replace(info, requirements=("./no/such/package",))
    with pytest.raises(SimulatorError, match="only half installed"):
        Environment.of(info).create()
    assert "half installed: simbench install sixth" in str(missing(info))


@pytest.mark.parametrize(
    ("marker", "python"),
    [(None, False), (None, True), ("", True), ("[]", True), ("{}", True), ("7", True),
     ('{"requirements": ["six==1.15.0"]}', True), ('{"requirements": ["six==1.16.0"]}', False)],
)  # fmt: skip
def test_what_is_wrong_with_one(info: SimulatorInfo, marker: str | None, python: bool) -> None:
    if python or marker is not None:
        environment = half_made(info)
        if marker is not None:
            (environment.folder / MARKER).write_text(marker)
        if not python:
            environment.python.unlink()
    told = str(missing(info)).replace(f"{Environment.of(info).folder}", "DIR")
    assert_approved_line("environments", f"{marker}, {python}: {told}")


def test_caches_are_kept_beside_it_unless_the_user_says_where(
    info: SimulatorInfo, monkeypatch: pytest.MonkeyPatch
) -> None:
    environment = Environment.of(info)
    kept = environment.variables()
    assert kept == {"SIXTH_CACHE": str(environment.folder / "cache" / "kernels")}
    monkeypatch.setenv("SIXTH_CACHE", "elsewhere")
    assert environment.variables() == {}


def test_what_a_program_says_that_fails_is_told_with_what_it_was_given() -> None:
    with pytest.raises(SimulatorError, match="1 failed: no answer of mine"):
        environments._run(["sh", "-c", "echo no answer; echo of $X; exit 1"], {"X": "mine"}, print)


ABSENT = "no_such_module_here"


def home(monkeypatch: pytest.MonkeyPatch, path: str | Path) -> None:
    """Let another interpreter be the system's."""
    monkeypatch.setattr(SystemPython, "python", Path(path))


@pytest.fixture
def packaged(monkeypatch: pytest.MonkeyPatch) -> SimulatorInfo:
    """A simulator whose engine no interpreter has; the system's is this one."""
    home(monkeypatch, sys.executable)
    return replace(
        MuJoCo.info,
        name="packaged",
        distribution="pip",
        modules=(ABSENT,),
        system_packages=("python3-numpy", "python3-packaged"),
        install="apt-get install python3-numpy python3-packaged",
    )


def test_absent_engine(packaged: SimulatorInfo) -> None:
    assert missing(packaged) == (
        f"packaged comes with packages of the system, and {sys.executable} has no module {ABSENT}; "
        "on Debian and Ubuntu: apt-get install python3-numpy python3-packaged; or name another: "
        "--sim-python packaged=PATH"
    )
    assert interpreter(packaged) is None


def test_one_module_of_several_is_enough(packaged: SimulatorInfo) -> None:
    """A package that is not there has no modules; asking for one is an error in Python."""
    versions = f"{ABSENT}.eight|{ABSENT}.nine"
    assert SystemPython(replace(packaged, modules=(f"{versions}|json.decoder",))).problem is None
    told = str(missing(replace(packaged, modules=(versions,))))
    assert f"has no module {ABSENT}.eight or {ABSENT}.nine; on Debian" in told


def test_engine_in_the_systems_python(
    packaged: SimulatorInfo, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The system's Python finds a module that this process does not find."""
    (tmp_path / f"{ABSENT}.py").write_text("raise SystemExit('a probe imports no engine')\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    packaged = replace(packaged, distribution="numpy")
    other = outside(packaged)
    assert isinstance(other, SystemPython)
    assert missing(packaged) is None
    assert interpreter(packaged) == sys.executable
    assert other.version() == sys.modules["numpy"].__version__
    assert other.place == f"in the system's Python, {sys.executable}"


def test_a_file_in_the_working_folder_is_no_engine(
    packaged: SimulatorInfo, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("PYTHONPATH", raising=False)
    monkeypatch.chdir(tmp_path)
    Path("another_absent_module.py").touch()
    Path("json.py").write_text("raise RuntimeError('stray')")
    packaged = replace(packaged, modules=("another_absent_module",))
    assert "no module another_absent_module" in str(SystemPython(packaged).problem)


def test_an_engine_that_is_importable_here_runs_here(packaged: SimulatorInfo) -> None:
    packaged = replace(packaged, modules=("json",))
    assert outside(packaged) is None
    assert missing(packaged) is None
    assert interpreter(packaged) is None


OLD = """echo '{"python": [3, 10, 12], "version": "1", "absent": []}'"""


@pytest.mark.parametrize("text", [None, "exit 1", "echo hello", "kill -9 $$", OLD])
def test_what_is_no_interpreter_for_us(
    packaged: SimulatorInfo, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, text: str | None
) -> None:
    path = tmp_path / "python3"
    home(monkeypatch, path)
    if text is not None:
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(0o755)
    told = str(missing(packaged)).replace(f"{path}", "PYTHON")
    assert_approved_line("environments", f"{text}: {told}")
    assert SystemPython(packaged).version() == ("1" if text == OLD else None)


PAGE = """<!DOCTYPE html><html><body>
<a href="../../files/engine-1.9.0-py3-none-any.whl#sha256=00">engine-1.9.0-py3-none-any.whl</a>
<a href="engine-1.10.0.tar.gz" data-requires-python="&gt;=3.8">engine-1.10.0.tar.gz</a>
<a href="engine-1.11.0.tar.gz" data-yanked="broken">engine-1.11.0.tar.gz</a>
<a href="engine-2.0.0rc1.tar.gz">engine-2.0.0rc1.tar.gz</a>
<a href="engine-3.0.0.tar.gz" data-requires-python="&gt;=99">engine-3.0.0.tar.gz</a>
<a href="engine-1.8.0-cp27-cp27m-win32.whl">engine-1.8.0-cp27-cp27m-win32.whl</a>
<a href="readme.txt">readme.txt</a> <a href="engine.whl">engine.whl</a>
</body></html>"""


@pytest.fixture(autouse=True)
def forget() -> None:
    package_index.releases.cache_clear()


def test_what_can_be_installed_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without yanked ones, pre-releases, and files for other Pythons and machines."""
    (tmp_path / "engine").mkdir()
    (tmp_path / "engine" / "index.html").write_text(PAGE)
    monkeypatch.setenv("PIP_INDEX_URL", tmp_path.as_uri())
    monkeypatch.setenv("PIP_EXTRA_INDEX_URL", (tmp_path / "empty").as_uri())
    assert releases("Engine") == ["1.9.0", "1.10.0"]
    with pytest.raises(PackageIndexError, match=r"no package index tells the releases of nosuch"):
        releases("nosuch")


def test_an_index_that_does_not_answer_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIP_INDEX_URL", "http://127.0.0.1:9/simple")
    monkeypatch.setenv("PIP_EXTRA_INDEX_URL", "http://127.0.0.1:9/more")
    with pytest.raises(PackageIndexError, match=r"127.0.0.1: .*refused.*; check the network"):
        releases("engine")


def test_a_name_and_a_password_are_no_part_of_the_address(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def answer(request: Request, timeout: float) -> io.BytesIO:
        asked.append((request.full_url, request.headers))
        return io.BytesIO(PAGE.encode())

    monkeypatch.setattr("urllib.request.urlopen", answer)
    monkeypatch.setenv("PIP_INDEX_URL", "https://me%40x:p%2Fw@host:8/simple/")
    monkeypatch.setenv("PIP_EXTRA_INDEX_URL", "https://me@host")
    assert releases("En_gine") == ["1.9.0", "1.10.0"]
    for secret, url in ((b"me@x:p/w", "https://host:8/simple/"), (b"me:", "https://host/")):
        basic = f"Basic {base64.b64encode(secret).decode()}"
        told = {"Accept": "text/html", "Authorization": basic}
        assert asked.pop(0) == (f"{url}en-gine/", told)


def test_the_last_of_each_minor_version() -> None:
    assert newest_of_minors(["3.10.0", "3.2.0", "3.2.7", "3.9.0"]) == ["3.2.7", "3.9.0", "3.10.0"]


@pytest.mark.parametrize(
    ("version", "near"),
    [("3.5", ["3.1", "3.2", "4.0", "4.1"]), ("9", ["3.1", "3.2", "4.0", "4.1"]),
     ("1", ["3.0", "3.1", "3.2", "4.0"])],
)  # fmt: skip
def test_the_nearest_releases(version: str, near: list[str]) -> None:
    assert nearest(version, ["3.0", "3.1", "3.2", "4.0", "4.1"]) == near


def test_no_release_is_one_sentence() -> None:
    assert unreleased("engine", "3.0.0", ["3.0", "3.1"]) == ""
    assert unreleased("engine", "4.0rc1", ["3.0"]) == ""  # whoever asks for one may have it
    assert unreleased("engine", "3.0+cu12", ["3.1"]) == ""
    told = unreleased("engine", "3.9", map(str, range(6)))
    assert told.startswith("the package index has no engine 3.9 for Python 3.")
    assert told.endswith("; the nearest releases are 2, 3, 4, 5")
    assert unreleased("engine", "abc", map(str, range(6))) == (
        "'abc' is no version; the newest releases are 2, 3, 4, 5"
    )


def test_environments_lie_with_the_user_s_data(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SIMBENCH_ENVIRONMENTS", raising=False)
    monkeypatch.setenv("XDG_DATA_HOME", "/d")
    assert environments.default_folder() == Path("/d/pytest-simbench/environments")
