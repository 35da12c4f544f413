"""Who can reach a cluster: with TLS nobody without a certificate; and no page is served unasked."""

from __future__ import annotations

import http.client
import re
import shutil
import subprocess
from pathlib import Path

import psutil
import pytest

from tests.cluster.machines import Machines

pytest.importorskip("distributed", reason="a cluster needs the extra 'cluster'")

TEST = """
    from tests.tiny import Falling

    def test_falling(repeat):
        repeat(Falling())
"""


@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl is not here")
def test_with_tls_only_who_has_a_certificate_is_served(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    """By the commands and the configuration of docs/cluster.md."""
    page = (request.config.rootpath / "docs" / "cluster.md").read_text("utf-8")
    place, nothing = pytester.mkdir("certificates"), pytester.mkdir("nothing")
    (commands,) = re.findall(r"```sh\n(umask.*?)```", page, re.DOTALL)
    subprocess.run(["sh", "-ec", commands], cwd=place, check=True, capture_output=True)
    (configuration,) = re.findall(r"```yaml\n(# ~/.config/dask.*?)```", page, re.DOTALL)
    (place / "dask.yaml").write_text(configuration.replace("/etc/simbench", str(place)))
    pytester.makepyfile(TEST)
    monkeypatch.setenv("DASK_CONFIG", str(place))
    with Machines(pytester.mkdir("machines"), head=["--tls"]) as machines:
        machines.node("a", "--sim", "mujoco")
        machines.wait("head", "a")
        arguments = ("--sim=mujoco", "--reps=1", f"--sim-cluster={machines.address}")
        pytester.runpytest_subprocess(*arguments).assert_outcomes(passed=1)
        monkeypatch.setenv("DASK_CONFIG", str(nothing))
        for address, message in (
            (machines.address, "tls:// needs certificates for the client"),
            (machines.address.replace("tls", "tcp"), "no scheduler of Dask answers"),
        ):
            refused = pytester.runpytest_subprocess(*arguments[:2], f"--sim-cluster={address}")
            assert refused.ret == pytest.ExitCode.USAGE_ERROR
            assert message in refused.stderr.str()


def answers(port: int) -> list[int]:
    """The status of each of Dask's pages at a port; none where nobody speaks HTTP."""
    found = []
    for path in ("/", "/status", "/health", "/info/main/workers.html", "/json/counts.json"):
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
        try:
            connection.request("GET", path)
            found.append(connection.getresponse().status)
        except (OSError, http.client.HTTPException):
            continue
        finally:
            connection.close()
    return found


@pytest.mark.parametrize("options", [[], ["--pages"]])
def test_pages_are_served_to_nobody_who_did_not_ask(tmp_path: Path, options: list[str]) -> None:
    with Machines(tmp_path, head=options) as machines:
        machines.wait("head")
        head = psutil.Process(machines.processes["head"].pid)
        ports = {c.laddr.port for c in head.net_connections("tcp") if c.status == "LISTEN"}
        found = [status for port in sorted(ports) for status in answers(port)]
    assert (200 in found) == bool(options)
