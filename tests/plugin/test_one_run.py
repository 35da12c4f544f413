"""A folder is one run and a row one configuration, whatever is typed, and however it is run."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.plugin.inner import records, run_pytest, usage_error

TEST = """
    from tests.tiny import Falling

    def test_falling(repeat):
        repeat(Falling(duration=0.2))
"""


def run(pytester: pytest.Pytester, *more: str, **outcomes: int) -> pytest.RunResult:
    return run_pytest(pytester, "--sim=mujoco --reps=1", *more, **outcomes)


def test_a_folder_with_a_run_is_refused_before_anything_runs(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(TEST)
    run(pytester, "--sim-output=o", passed=1)
    before = {path: path.read_bytes() for path in Path("o").rglob("*") if path.is_file()}
    for arguments in (["--sim-output=o", "--sim-set=mujoco.timestep=0.004"],
                      ["--sim-output=o/.", "-n2"]):  # fmt: skip
        result = run(pytester, *arguments)
        usage_error(result, "ERROR: *o already holds a run; complete that one with*")
    assert {path: path.read_bytes() for path in before} == before
    # The ini file names a folder for every run: those that record nothing may go on.
    pytester.makeini("[pytest]\nsim_output = o\n")
    result = run(pytester)
    usage_error(result, "ERROR: *already holds a run; *")
    result = run(pytester, "-n2", errors=1)
    result.stdout.fnmatch_lines(["*already holds a run; *"])
    assert "simulator comparison" not in result.stdout.str()
    unrelated = pytester.makepyfile(test_unrelated="def test_it(): pass")
    for more in ([], ["-n1"]):
        result = run(pytester, str(unrelated), *more, passed=1)
        assert "simulator comparison" not in result.stdout.str()
    assert run(pytester, "--collect-only", "-q").ret == pytest.ExitCode.OK
    assert {path: path.read_bytes() for path in before} == before


def test_a_run_is_resumed_whatever_folder_the_ini_file_names(pytester: pytest.Pytester) -> None:
    """Typed beside it, another folder is a mistake, and the same one is none."""
    pytester.makepyfile(TEST)
    run(pytester, "--sim-output=o", passed=1)
    pytester.makeini("[pytest]\nsim_output = p\n")
    run(pytester, "--sim-resume=o", passed=1)
    run(pytester, "--sim-resume=o", "--sim-output", str(pytester.path / "o"), passed=1)
    result = run(pytester, "--sim-resume=o", "--sim-output=p")
    usage_error(result, "ERROR: *a run is completed in its own folder, so leave out --sim-output")
    assert not Path("p").exists()


@pytest.mark.parametrize("words", ["--sim-output=o", "--sim-output=o -n1", "-osim_output=o -n1"])
def test_two_processes_on_one_folder(pytester: pytest.Pytester, words: str) -> None:
    pytester.makepyfile(TEST.replace("0.2", "30.0"))
    command = [sys.executable, "-m", "pytest", "--sim=mujoco", "--reps=2", *words.split()]
    both = [
        subprocess.Popen(
            command,
            cwd=pytester.path,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        for _ in range(2)
    ]
    told = [process.communicate(timeout=300) for process in both]
    assert sorted(process.returncode for process in both) in ([0, 4], [0, 1]), told
    assert [r["repetition"] for r in records(pytester.path / "o")] == [1, 2]
    (refused,) = [out + err for (out, err), p in zip(told, both, strict=True) if p.returncode]
    assert b"another run is under way in" in refused or b"already holds a run" in refused


SETTINGS = """
    import pytest
    from tests.tiny import Falling

    @pytest.fixture(params=[0.001, 0.004])
    def sim_settings(request):
        return {"timestep": request.param}

    class TestA:
        def test_falling(self, repeat):
            repeat(Falling(duration=0.2))

    class TestB:
        def test_falling(self, repeat):
            repeat(Falling(duration=0.2))
            repeat(Falling(duration=0.1))
"""


@pytest.mark.parametrize(
    "arguments", [[], ["-n2"], ["--sim-jobs=2"]], ids=["plain", "xdist", "jobs"]
)
def test_each_setting_class_and_task_is_a_row_with_files_of_its_own(
    pytester: pytest.Pytester, arguments: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    pytester.makepyfile(SETTINGS)
    run(pytester, "--sim-output=o", "--sim-trace=on", *arguments, passed=4)
    found = records(pytester.path / "o")
    assert len(found) == 6
    for folder, ending in (("logs", "log"), ("traces", "npz")):
        names = [path.name for path in (pytester.path / "o" / folder).iterdir()]
        assert len(names) == 6
        assert all(name.endswith(f"-1.{ending}") for name in names)
    assert len({r["notes"]["log"] for r in found}) == 6
    table = (pytester.path / "o" / "report.md").read_text()
    for step in ("0.001", "0.004"):
        assert table.count(f"TestA::test\\_falling timestep={step} | 0 of 1") == 1
        for duration in ("0.2", "0.1"):
            assert f"TestB::test\\_falling timestep={step} task.duration={duration} |" in table
    run(pytester, "--sim-resume=o", "--sim-trace=on", *arguments, passed=4)
    assert records(pytester.path / "o") == found


def test_the_gate_and_saved_benchmarks_keep_them_apart(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(SETTINGS)
    run(pytester, "--sim-output=a", "--benchmark-json=a.json", passed=4)
    for baseline in ("a", "a.json"):
        result = run(pytester, f"--sim-baseline={baseline}", f"--sim-output=o-{baseline}", passed=4)
        text = result.stdout.str()
        assert "different in the baseline" not in text
        assert "is not in the baseline" not in text
        assert "did not run" not in text
        assert "test_falling[0.004-mujoco-headless] (falling 2)" in text
    saved = json.loads((pytester.path / "a.json").read_text())["benchmarks"]
    steps = {b["name"]: b["extra_info"]["settings"]["timestep"] for b in saved}
    assert {(n.split("[")[1][:5], s) for n, s in steps.items()} == {
        ("0.001", 1e-3),
        ("0.004", 4e-3),
    }
    both = [len(b["extra_info"]["simbench"]["repetitions"]) for b in saved]
    assert sorted(both) == [1, 1, 2, 2]


def test_a_second_attempt_replaces_the_first_in_tables_and_both_stay(
    pytester: pytest.Pytester,
) -> None:
    """As pytest-rerunfailures does: the same test, once more in the same process."""
    pytester.makeconftest(
        """
        from _pytest.runner import runtestprotocol

        def pytest_runtest_protocol(item, nextitem):
            runtestprotocol(item, nextitem=nextitem, log=False)
            item._initrequest()
        """
    )
    pytester.makepyfile(TEST)
    path = pytester.path / "o"
    result = run(pytester, "--sim-output=o", passed=1)
    result.stdout.fnmatch_lines(["falling: 1 repetition, protocol fast"])
    assert [(r["repetition"], r["attempt"]) for r in records(path)] == [(1, 1), (1, 2)]
    assert len(list((path / "logs").iterdir())) == 2
    found = records(path)
    result = run_pytest(pytester, "--sim=mujoco --reps=2 --sim-resume=o", passed=1)
    result.stdout.fnmatch_lines(["falling: 2 repetitions, protocol fast"])
    assert records(path)[:2] == found
    assert [(r["repetition"], r["attempt"]) for r in records(path)[2:]] == [(2, 1), (2, 2)]


@pytest.mark.usefixtures("drawn")
def test_what_could_not_be_written_is_said_and_not_shown_as_there(
    pytester: pytest.Pytester,
) -> None:
    pytester.makepyfile(TEST)
    folder = pytester.mkdir("o")
    (folder / "report.md").mkdir()
    result = run(pytester, "--sim-output=o", passed=1)
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    result.stdout.fnmatch_lines(["*o/report.md could not be written (Is a directory)"])
    assert "report: " not in result.stdout.str()
    assert (folder / "report.html").is_file()
    assert (folder / "report.csv").is_file()
    assert not list(folder.glob("*.part"))


def test_a_folder_deleted_while_running_loses_no_record(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        import shutil
        from tests.tiny import Falling

        def test_falling(repeat, output_path):
            repeat(Falling(duration=0.2))
            shutil.rmtree(output_path)
            repeat(Falling(duration=0.1))
        """
    )
    result = run(pytester, "--sim-output=o", passed=1)
    result.stdout.fnmatch_lines(["*task.duration=0.1*", "*task.duration=0.2*"])
    assert len(records(pytester.path / "o")) == 1
