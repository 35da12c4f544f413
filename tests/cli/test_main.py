"""The command `simbench`: its help, what it lists, and one sentence for whatever cannot be."""

from __future__ import annotations

import subprocess
import sys
from fnmatch import fnmatchcase
from pathlib import Path
from types import SimpleNamespace

import pytest

import pytest_simbench
from pytest_simbench.cli import environments, robots, simulators
from pytest_simbench.cli.main import COMMANDS, GROUPS
from pytest_simbench.cli.names import progress
from pytest_simbench.simulator.registry import adapter, registered
from tests.approval import assert_approved, assert_approved_line
from tests.cli.command import said
from tests.cluster.machines import release_in
from tests.motion.small_arm import URDF, small_arm

NAMES = [command.name for command in COMMANDS]


@pytest.fixture(autouse=True)
def no_environments(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("SIMBENCH_ENVIRONMENTS", str(tmp_path / "environments"))


def test_help_names_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = said(capsys, "--help")
    assert status == 0
    shown = " ".join(out.split())
    told = GROUPS | {c.name: c.help for c in COMMANDS if " " not in c.name}
    assert [name for name, text in told.items() if f" {name} {text}" not in shown] == []
    assert said(capsys)[::2] == (2, out)


@pytest.mark.parametrize("name", NAMES)
def test_every_command_has_help(capsys: pytest.CaptureFixture[str], name: str) -> None:
    status, out, _ = said(capsys, *name.split(), "--help")
    assert status == 0
    assert out.startswith(f"usage: simbench {name} [-h]")


@pytest.mark.parametrize(
    "command",
    [[sys.executable, "-m", "pytest_simbench"], [str(Path(sys.executable).parent / "simbench")]],
)
def test_it_is_installed(command: list[str]) -> None:
    """By both of its names; nothing but the standard library is loaded for help."""
    found = subprocess.run(
        [*command, "robots", "panda"], text=True, capture_output=True, check=True
    )
    assert "panda: 7 arm joints, 2 fingers that open to " in found.stdout


def test_help_loads_nothing_large() -> None:
    script = (
        "import sys; from pytest_simbench.cli.main import parser; parser().format_help(); "
        "print({'numpy', 'pytest', 'pinocchio'} & {*sys.modules})"
    )
    root = Path(pytest_simbench.__file__).parents[1]
    found = subprocess.run([sys.executable, "-c", script], cwd=root, text=True, capture_output=True)
    assert found.stdout == "set()\n"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("lst", "simbench: argument COMMAND: invalid choice: 'lst' (choose from 'list', *"),
        ("list nosuch", "simbench list: unknown simulator 'nosuch'; choose from *mujoco*"),
        ("list mujoco@nowhere/x", "simbench list: mujoco@nowhere/x: there is no such file; *"),
        ("list mujoco --settings ode", "simbench list: give names, or --settings SIM alone"),
        ("list --settings mujoko", "simbench list: unknown simulator 'mujoko'; choose from *"),
        ("list --cluster x", "*--cluster: write it as tcp://HOST:PORT or tls://HOST:PORT; *"),
        ("cluster head --port 99999", "*--port: give a whole number from 0 to 65535; *"),
        ("cluster node x", "*ADDRESS: write it as tcp://HOST:PORT or tls://HOST:PORT; *"),
        ("robots nosuch", "simbench robots: *nosuch*panda*"),
        ("install nosuch", "simbench install: unknown simulator 'nosuch'; choose from *"),
        ("install mujoco", "simbench install: mujoco needs no environment of its own: *"),
        ("install", "simbench install: the following arguments are required: NAME; *"),
        ("uninstall x", "simbench uninstall: there is no environment 'x' in *; none is there"),
        ("download nosuch", "*no data set 'nosuch'; choose from cube_tosses*"),
        ("merge", "simbench merge: the following arguments are required: RUN; *"),
        ("merge none", "simbench merge: none: cannot read records from *"),
        ("merge a a", "simbench merge: a: the run is given twice"),
        ("merge a b", "simbench merge: a and b overlap: both have seed 2022 of *"),
        ("merge a --output b", "simbench merge: b already holds a run; give another --output"),
        ("merge empty", "simbench merge: empty holds no repetition that ended: leave it out"),
        ("report none", "simbench report: none: cannot read records from *No such file*"),
        ("report empty", "simbench report: empty: it holds no repetition"),
        ("report bad", "simbench report: bad: bad/records.jsonl:1: not JSON*"),
        ("report a ./a", "simbench report: ./a: the run is given twice"),
        ("report a b", "simbench report: a and b overlap: both have seed 2022 of *"),
        ("report a --output b", "simbench report: b holds another run; give another --output"),
        ("bisect mujoco:3.2.7..3.3.7 placed no.py::test_x", "*there is no file no.py; name the *"),
        ("bisect mujoco:3..4 a-b", "*METRIC: give the name of a metric; *"),
        ("watch nosuch", "simbench watch: unknown simulator 'nosuch'; choose from *mujoco*"),
        ("watch ode", "simbench watch: ode: no package index has its releases; choose from *"),
        ("watch coppeliasim", "*coppeliasim: no package index has its releases; choose from *"),
        ("watch mujoco==3.3.7", "*: name the simulator alone; --since mujoco==3.3.7 begins *"),
        ("watch --since mujoco", "*: --since mujoco: write it as NAME==RELEASE or *"),
        (
            "watch --since mujoco==3.2.7 --since mujoco==4.0.0",
            "*: --since mujoco==4.0.0: mujoco==3.2.7 says already where mujoco begins",
        ),
        ("watch mujoco --scene no.xml", "*: --scene no.xml: there is no such file; give an *"),
        ("watch mujoco --limit no:5%", "*: --limit: no metric is named 'no'; valid names: *"),
        ("watch mujoco --output seen", "*: seen/watch.json: *; remove it to begin anew"),
        ("stats more", "*unrecognized arguments: more*"),
    ],
)
def test_what_cannot_be_is_one_sentence(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    request: pytest.FixtureRequest,
    words: str,
    sentence: str,
) -> None:
    real = Path(request.config.rootpath, "tests/measure/stacking_records.jsonl")
    first = real.read_text().splitlines()[0] + "\n"
    for name, text in (("a", first), ("b", first), ("bad", "no record\n"), ("empty", "")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "records.jsonl").write_text(text)
    (tmp_path / "seen").mkdir()
    (tmp_path / "seen" / "watch.json").write_text('{"seen": 1}')
    monkeypatch.chdir(tmp_path)
    status, _, told = said(capsys, *words.split())
    assert status == 2
    assert told.count("\n") == 1
    assert fnmatchcase(told.splitlines()[-1], sentence)
    if words != "lst":  # which each Python words in its own way
        assert_approved_line(
            "refused", f"simbench {words}: {told[:-1]}".replace(f"{tmp_path}", "DIR")
        )


def test_all_that_is_said_of_simulators_that_are_not_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """And their settings: what each means, what profiles have, and what is searched."""
    monkeypatch.setenv("COLUMNS", "200")
    lines = [*simulators._paragraphs((), lambda name: f"no {name}", {}, True)]
    for name in registered():
        lines += ["", *simulators._settings(name)]
    assert_approved("simulators", "\n".join(lines))


def test_the_list_is_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = said(capsys, "list")
    heading, *lines = out.splitlines()
    assert status == 0
    assert heading.split() == ["simulator", "version", "ready", "tuned", "real", "step"]
    assert [line.split()[0] for line in lines] == list(registered())
    (mujoco,) = (line.split() for line in lines if line.startswith("mujoco"))
    assert mujoco[2:] == ["yes", "yes", "yes", "1", "ms"]
    own = [name for name in registered() if adapter(name).info.requirements]
    assert own
    for name in own:
        assert f"no: not here; simbench list {name} says how to get it\n" in out


def test_a_broken_adapter_hides_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulators, "known", lambda: ["drake", "mujoco", "ode", "sapien"])
    monkeypatch.setattr(simulators, "problem", {"drake": "no class"}.get)
    monkeypatch.setattr(simulators, "_version", {"ode": "0.16.6"}.get)
    lines = [*simulators._table({"mujoco": "no"}.get)]
    assert [" ".join(line.split()) for line in lines[1:]] == [
        "drake - BROKEN: no class",
        "mujoco - no: not here; simbench list mujoco says how to get it",
        "ode 0.16.6 yes yes yes 2 ms",
        "sapien - yes yes yes 4 ms",
    ]
    lines = [*simulators._paragraphs(["drake", "ode"], lambda name: None, {"ode": "/o"}, False)]
    assert lines[:2] == ["drake: BROKEN: no class", ""]
    assert lines[2].startswith("ode: ")
    assert (lines[3], lines[-1]) == ("    in /o", "")


def test_a_simulator_s_place_is_told_with_its_version(monkeypatch: pytest.MonkeyPatch) -> None:
    def place(version: str | None, environment: str | None) -> str:
        other = SimpleNamespace(place=environment or "half made")  # that one is not used
        monkeypatch.setattr(simulators, "_version", lambda name: version)
        monkeypatch.setattr(simulators.environments, "interpreter", lambda info: environment)
        monkeypatch.setattr(simulators.environments, "outside", lambda info: other)
        return simulators._place("mujoco", {})

    assert place("3.4.0", None) == "version 3.4.0, installed"
    assert place("0.0.1", None) == "version 0.0.1, UNTESTED, installed"
    assert place(None, "there") == "version not known, there"


def test_one_simulator_is_told_whole(capsys: pytest.CaptureFixture[str]) -> None:
    name = next(name for name in registered() if adapter(name).info.requirements)
    _, out, _ = said(capsys, "list", name)
    assert f"not there yet: simbench install {name}" in out
    assert "    modes: headless" in out
    assert "deviates" not in out
    assert "deviates" in said(capsys, "list", "-v", "mujoco")[1]
    everything = said(capsys, "list", "-v")[1]
    assert all(f"\n{name}: {adapter(name).info.title}" in everything for name in registered())
    capabilities = everything.partition("\n\ncoppeliasim: ")[0]
    assert "deterministic" in capabilities
    assert max(map(len, capabilities.splitlines())) <= 100  # where no terminal says its width


def test_robots_and_their_files(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = said(capsys, "robots")[1]
    assert_approved("robots", out)
    for line in (
        "panda: 7 arm joints, 2 fingers that open to 0.035 m, base at (0, 0, 0)",
        "so101: 5 arm joints, one jaw that opens to 1 rad, base at (0, 0, 0)",
        "ur5: 6 arm joints, 2 fingers",
    ):
        assert line in out
    status, out, _ = said(capsys, "robots", str(small_arm(tmp_path)))
    assert status == 0
    lines = (
        "small: 3 arm joints, 2 fingers that open to 0.04 m, base at (0.1, 0, 0.2)",
        "    no stacking: robot 'small' cannot handle a cube at (0.12, -0.18, 0.20): *",
        "    no throwing: robot 'small' has no swing for the throw: write one into its file*",
        "    no pushing: robot 'small' cannot push the block: unreachable: *",
    )
    for line, pattern in zip(out.splitlines(), lines, strict=True):
        assert fnmatchcase(line, pattern)
    oiled = URDF.replace("</joint>", '<dynamics damping="5" friction="0.0"/></joint>', 2)
    out = said(capsys, "robots", str(small_arm(tmp_path, urdf=oiled)))[1]
    assert "    not used of the URDF: damping and friction of turn, lift (<dynamics>)\n" in out


def test_a_broken_robot_hides_no_other(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(robots, "known", lambda: ["gone", "ur5"])
    status, out, _ = said(capsys, "robots")
    assert status == 1
    assert out.startswith("gone: BROKEN: unknown robot 'gone'; choose from panda, ")
    assert "\nur5: 6 arm joints" in out


def test_where_no_terminal_is_an_installation_tells_its_end(
    capsys: pytest.CaptureFixture[str],
) -> None:
    tell = progress()
    for text in ("\r1 MB", "\r2 MB\n", "done\n"):
        tell(text)
    assert capsys.readouterr().out == "2 MB\ndone\n"


def test_environments_come_and_go(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name = release_in(tmp_path / "environments")
    assert said(capsys, "environments") == (
        0, f"{name}: 0 MB, MuJoCo None\n0 MB in {tmp_path / 'environments'}\n", ""
    )  # fmt: skip
    assert said(capsys, "uninstall", name) == (0, f"{name}: removed, 0 MB\n", "")
    assert "; none is there" in said(capsys, "uninstall", name)[2]


@pytest.mark.parametrize("command", ["environments", "cluster head"])
def test_an_interruption_is_one_sentence(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    def interrupted(**words: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(environments, "list_environments", interrupted)
    monkeypatch.setattr("pytest_simbench.cluster.serving.head", interrupted)
    name, *_ = words = command.split()
    told = f"simbench {name}: interrupted; nothing that it read was changed\n"
    assert said(capsys, *words) == (130, "", told)


def test_a_reader_that_ends_early_is_no_fault() -> None:
    command = f"'{sys.executable}' -m pytest_simbench list -v | head -1"
    found = subprocess.run(command, shell=True, capture_output=True, text=True)
    assert found.stderr == ""


def test_a_full_disk_is_one_sentence() -> None:
    command = [sys.executable, "-m", "pytest_simbench", "list"]
    with open("/dev/full", "w") as full:
        found = subprocess.run(command, stdout=full, stderr=-1, text=True)
    told = "simbench list: the output could not be written (No space left on device)\n"
    assert (found.returncode, found.stderr) == (1, told)


def test_settings_are_listed(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    narrow = said(capsys, "list", "--settings", "mujoco")[1]
    assert max(map(len, narrow.splitlines())) <= 80
    assert "\nsolver             Newton          Newton             Newton\n" in narrow
    assert "\n    of the constraints. Searched: PGS or CG or Newton.\n" in narrow
    monkeypatch.delenv("COLUMNS")
    status, told, _ = said(capsys, "list", "--settings", "mujoco")
    assert status == 0
    assert "solref             0.02/1 " in told
    assert "0.001 to 0.05 log, 0.5 to 4 log " in told
