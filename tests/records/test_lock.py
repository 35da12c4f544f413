"""The lock: one run in a folder, never two at once."""

from __future__ import annotations

import errno
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from pytest_simbench.records.lock import FolderLock
from pytest_simbench.records.paths import FolderError


def test_a_folder_is_one_run_at_a_time(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "run"
    lock = FolderLock(folder)
    with pytest.raises(FolderError, match=f"another run is under way in {folder}; wait for it"):
        FolderLock(folder)
    lock.close()
    FolderLock(folder).close()


def test_another_process_is_refused_and_a_dead_one_holds_nothing(tmp_path: Path) -> None:
    code = """
import sys, time
from pathlib import Path
from pytest_simbench.records.lock import FolderLock
lock = FolderLock(Path(sys.argv[1]))
print("mine", flush=True)
time.sleep(600)
"""
    process = subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "mine\n"
    with pytest.raises(FolderError, match="another run is under way"):
        FolderLock(tmp_path)
    process.kill()
    process.wait()
    FolderLock(tmp_path).close()


def test_the_processes_of_one_run_share_it(tmp_path: Path) -> None:
    workers = [FolderLock(tmp_path, shared=True) for _ in range(2)]
    workers.pop(0).close()
    with pytest.raises(FolderError, match="another run is under way"):
        FolderLock(tmp_path)  # somebody resumes it meanwhile
    for worker in workers:
        worker.close()
    controller = FolderLock(tmp_path)
    FolderLock(tmp_path, shared=True).close()
    controller.close()


def test_a_folder_made_for_nothing_goes_away(tmp_path: Path) -> None:
    FolderLock(tmp_path / "new" / "run").close()
    assert not (tmp_path / "new").exists()
    (tmp_path / "old").mkdir()
    FolderLock(tmp_path / "old").close()
    assert (tmp_path / "old").exists()
    lock = FolderLock(tmp_path / "used" / "run")
    (tmp_path / "used" / "run" / "records.jsonl").touch()
    lock.close()
    assert (tmp_path / "used" / "run").exists()


@pytest.mark.parametrize(
    ("number", "why"),
    [(errno.EIO, "cannot be locked (Input/output error)"), (errno.ENOLCK, ""),
     (errno.ENOTSUP, ""), (errno.EBADF, ""), (errno.EINVAL, "")],
)  # fmt: skip
def test_a_file_system_without_locks_gives_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, why: str
) -> None:
    def flock(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("fcntl.flock", flock)
    if why:
        with pytest.raises(FolderError, match=re.escape(f"the run folder {tmp_path / 'a'} {why}")):
            FolderLock(tmp_path / "a")
        assert not (tmp_path / "a").exists()
    else:
        FolderLock(tmp_path / "a").close()


@pytest.mark.parametrize("kind", ["file", "through", "link", "loop", "refused", "long"])
def test_what_can_be_no_folder_is_one_sentence(tmp_path: Path, kind: str) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    path, message = {
        "file": (tmp_path / "file", f"{tmp_path}/file is a file"),
        "through": (tmp_path / "file" / "a" / "b", f"{tmp_path}/file is a file"),
        "link": (tmp_path / "link" / "a", f"{tmp_path}/link is a link to nothing"),
        "loop": (tmp_path / "loop", f"{tmp_path}/loop is a link to nothing"),
        "refused": (Path("/proc/nothing"), "No such file or directory"),
        "long": (tmp_path / ("x" * 300), "File name too long"),
    }[kind]
    with pytest.raises(FolderError) as caught:
        FolderLock(path)
    expected = f"the run folder {path} cannot be made ({message}); give another folder"
    assert str(caught.value) == expected


def test_a_path_that_is_no_utf8_is_refused_by_its_name(tmp_path: Path) -> None:
    """Workers are told where it is in UTF-8; nothing is made of it."""
    folder = tmp_path / os.fsdecode(b"lat\xfc") / "run"
    with pytest.raises(FolderError, match=r"lat.udcfc/run' is no UTF-8, .*; give another folder"):
        FolderLock(folder)
    assert not folder.parent.exists()


def test_no_space_is_noticed_before_anything_runs(tmp_path: Path) -> None:
    """The file-size limit of a child process refuses a write as a full disk does."""
    code = """
import resource, signal, sys
from pathlib import Path
from pytest_simbench.records.lock import FolderLock
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
FolderLock(Path(sys.argv[1]))
"""
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, check=False
    )
    assert "FolderError: the run folder" in done.stderr
    assert "cannot be written to (File too large); give another folder" in done.stderr
    assert list(tmp_path.iterdir()) == []
