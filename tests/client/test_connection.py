"""Workers that execnet starts, on other hosts too, and what it must not do by itself."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import psutil
import pytest
from execnet.gateway_io import popen_bootstrapline

from pytest_simbench import __version__
from pytest_simbench.client import process
from pytest_simbench.client.connection import BOOTSTRAP, OPENED, Connection
from pytest_simbench.client.errors import Where
from pytest_simbench.client.launch import Launch
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.experiment.case import Case
from pytest_simbench.worker.wire import Frames
from tests.client.failing import failure
from tests.conftest import performed
from tests.tiny import Falling


def test_modules_of_the_current_folder_are_not_imported(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert popen_bootstrapline.startswith(BOOTSTRAP)
    for name in ("queue", "tempfile", "ctypes", "struct", "json"):
        (tmp_path / f"{name}.py").write_text("raise RuntimeError('stray')")
    monkeypatch.chdir(tmp_path)
    performed(case, Falling())


RAISES = """
import gc, time, types
from pathlib import Path
from pytest_simbench.client.connection import Connection
module = types.ModuleType("module")
module.__file__ = "FILE"
connection = Connection(None, None, {}, None)
connection.open(module, {})
print(connection.receive(60.0) is not None)
time.sleep(1.0)
connection.cut()
connection.close()
del connection
gc.collect()
"""


def test_an_error_that_nobody_asked_for_is_not_printed(tmp_path: Path) -> None:
    there = tmp_path / "there.py"
    there.write_text("if __name__ == '__channelexec__': raise ValueError('late')")
    script = RAISES.replace("FILE", str(there))
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert (done.stdout, done.stderr) == ("True\n", "")


def test_threads_that_multiplied_matrices_do_not_wait_at_full_speed(tmp_path: Path) -> None:
    """A policy inside the worker begins them, and the steps after it would count their time."""
    module = ModuleType("module")
    module.__file__ = str(tmp_path / "there.py")
    Path(module.__file__).write_text(
        "import time, numpy as np; np.ones((900, 900)) @ np.ones((900, 900))\n"
        "before = time.process_time(); time.sleep(0.1); spent = time.process_time() - before\n"
        "if __name__ == '__channelexec__': channel.send(spent)\n"
    )
    connection = Connection(None, None, {}, None)
    connection.open(module, {})
    assert [connection.receive(60.0), connection.receive(60.0) < 0.005] == [OPENED, True]
    connection.cut()
    connection.close()


def test_the_mark_that_ends_a_loop_is_read_before_the_answer_that_is_here_already() -> None:
    """Else the next loop's first question came four bytes late: numbers, but not the state's."""
    connection = Connection(None, None, {}, None)
    theirs = Frames(connection._theirs)
    theirs.send(b"")
    connection._arrived("answer")
    assert connection.take(5.0) == "answer"
    theirs.send(b"question")
    theirs.send(b"")
    assert connection.take(5.0) == b"question"
    connection._arrived("next answer")
    assert connection.take(5.0) == "next answer"
    connection._arrived("an error without a mark")
    assert connection.take(0.1) == "an error without a mark"
    connection.exchange.close()
    connection._theirs.close()


SSHD = shutil.which("sshd") or "/usr/sbin/sshd"


@pytest.fixture
def host(tmp_path: Path) -> Iterator[str]:
    """An execnet specification of a host behind a real ssh server, on this machine's loopback."""
    if not os.path.exists(SSHD):
        pytest.skip("no ssh server here: apt-get install openssh-server")
    for name in ("host", "user"):
        command = ["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(tmp_path / name)]
        subprocess.run(command, check=True)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    if os.geteuid() == 0:
        Path("/run/sshd").mkdir(exist_ok=True)
    (tmp_path / "sshd_config").write_text(
        f"Port {port}\nListenAddress 127.0.0.1\nHostKey {tmp_path / 'host'}\n"
        f"AuthorizedKeysFile {tmp_path / 'user.pub'}\nStrictModes no\nPidFile none\n"
        "PermitRootLogin yes\n"
    )
    (tmp_path / "ssh_config").write_text(
        f"Host lab\n  HostName 127.0.0.1\n  Port {port}\n  IdentityFile {tmp_path / 'user'}\n"
        "  StrictHostKeyChecking no\n  UserKnownHostsFile /dev/null\n  LogLevel ERROR\n"
    )
    server = subprocess.Popen([SSHD, "-D", "-e", "-f", str(tmp_path / "sshd_config")])
    for _ in range(100):
        with socket.socket() as trial:
            if trial.connect_ex(("127.0.0.1", port)) == 0:
                break
        time.sleep(0.1)
    yield f"ssh=lab//ssh_config={tmp_path / 'ssh_config'}//python={sys.executable}"
    server.terminate()
    server.wait()


def test_another_host(case: Case, host: str) -> None:
    local, remote = (performed(replace(case, spec=spec), Falling()) for spec in (case.spec, host))
    assert remote.metrics == local.metrics
    assert remote.versions == local.versions
    assert remote.resources.get("rss_mb") is None  # its processes cannot be watched from here


def test_a_host_without_this_run_folder(case: Case, tmp_path: Path) -> None:
    """The worker logs to a temporary folder of its own there; on this machine it goes with it."""
    launch = Launch(case.adapter, log=tmp_path / "not here" / "worker.log")
    process = WorkerProcess(launch, Where("mujoco", "headless"))
    assert process.request("hello")["pid"] == process.pid
    folder = Path(psutil.Process(process.pid).cwd())
    assert folder.name.startswith("simbench-")
    assert (folder / "worker.log").exists()
    process.close()
    assert not folder.exists()


def test_an_unknown_host(case: Case) -> None:
    spec = "ssh=-o ConnectTimeout=2 no-such-host.invalid//python=python3"
    kind, _, message = failure(replace(case, spec=spec, stall_timeout=10.0))
    assert kind == "WorkerStartError"
    assert "no-such-host.invalid" in message


def test_a_popen_specification(case: Case) -> None:
    spec = f"popen//execmodel=main_thread_only//python={sys.executable}"
    record = performed(replace(case, spec=spec), Falling())
    assert record.resources["rss_mb"]["peak"] > 20


def test_another_version_of_this_package_is_told(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(process, "__version__", "0.0")
    kind, _, message = failure(case, Falling())
    told = (
        f"runs pytest-simbench {__version__}, this is 0.0; install the same version on both sides"
    )
    assert kind == "WorkerStartError"
    assert told in message
