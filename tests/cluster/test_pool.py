"""What nodes offer, which of them a repetition goes to, and what is said where none will do."""

from __future__ import annotations

import asyncio
import socket
import threading
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest

from pytest_simbench.cli.main import main
from pytest_simbench.client.errors import ExecutorError
from pytest_simbench.cluster import pool as module
from pytest_simbench.cluster import serving
from pytest_simbench.cluster.executor import ClusterExecutor
from pytest_simbench.cluster.job import Packed
from pytest_simbench.cluster.offers import PYTHON, Node, here, plugin, refusal, unmet
from pytest_simbench.cluster.pool import TLS, Pool, reason
from pytest_simbench.cluster.serving import not_taken
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.simulator.registry import adapter
from tests.cluster.machines import release_in
from tests.tiny import Falling

PLUGIN = plugin()


def node(name: str, *offers: str, slots: int = 1) -> Node:
    found = Node.of(f"tcp://{name}:1", name, dict.fromkeys(("simbench", *offers), float(slots)))
    assert found is not None
    return found


def lab(name: str, *offers: str) -> Node:
    return node(name, PLUGIN, PYTHON, *offers)


@pytest.mark.engine
def test_a_machine_offers_what_is_ready_on_it() -> None:
    offers = here(3, ["mujoco"])
    assert set(offers.values()) == {3.0}
    found = Node.of("tcp://here:1", "here", offers)
    assert found.slots == 3
    assert found.versions["mujoco"]
    assert found.has("mujoco", "headless")
    assert not found.has("pybullet", "headless")
    assert not found.stranger


@pytest.mark.engine
def test_a_release_with_an_environment_of_its_own_is_offered_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SIMBENCH_ENVIRONMENTS", str(tmp_path))
    name = release_in(tmp_path)
    (tmp_path / "mujoco==0.1").mkdir()  # half made
    (tmp_path / "nothing==1.0").mkdir()
    found = Node.of("tcp://here:1", "here", here(1))
    assert found.has(name, "headless")
    assert found.versions["mujoco"] == adapter("mujoco").info.tested_version
    assert [(n, v) for n, v in found.versions.items() if "==" in n] == [(name, "unknown")]
    assert f", {name}," in str(found)
    assert str(unmet([lab("lab1", "mujoco==4.0.0")], name, ["headless"])) == (
        f"no node of the cluster offers {name}: lab1 has mujoco 4.0.0; on one of them: "
        f"simbench install {name}, and start it again"
    )


def test_a_worker_of_somebody_elses_is_no_node() -> None:
    assert Node.of("tcp://other:1", "other", {"GPU": 2.0}) is None


def test_what_nobody_has_or_in_several_versions_is_named_with_what_each_has() -> None:
    nodes = [lab("lab1", "mujoco==3.3.7"), lab("lab2", "drake==1.51.1", "display")]
    assert unmet(nodes, "mujoco", ["headless"]) is None
    assert unmet(nodes, "sapien", ["headless"]) == (
        "no node of the cluster offers sapien: lab1 has mujoco 3.3.7; "
        "lab2 has drake 1.51.1, display"
    )
    assert unmet(nodes, "drake", ["headless", "gui"]) is None
    assert str(unmet(nodes, "mujoco", ["gui"])).startswith(
        "no node of the cluster offers mujoco with a display: "
    )
    nodes = [lab("lab1", "mujoco==3.3.7"), lab("lab2", "mujoco==3.4.0"), lab("lab3")]
    assert unmet(nodes, "mujoco", ["headless"]) == (
        "the nodes of the cluster have several versions of mujoco: 3.3.7 (lab1), 3.4.0 (lab2); "
        "their results do not belong together, so give the run nodes of one version"
    )
    none = "no node of the cluster offers"
    assert unmet(nodes[2:], "mujoco==3.3.7", ["headless"]) == (
        f"{none} mujoco==3.3.7: lab3 has no simulator; on one of them: "
        "simbench install mujoco==3.3.7, and start it again"
    )
    nodes = [lab("lab1"), lab("lab2", "mujoco==3.3.7==3.3.7"), lab("lab3")]
    assert unmet(nodes, "mujoco==3.3.7", ["headless", "gui"]) == (
        f"{none} mujoco==3.3.7 with a display: lab1 has no simulator; lab2 has mujoco==3.3.7; "
        "lab3 has no simulator"
    )


@pytest.mark.parametrize(
    ("stranger", "words"),
    [
        (node("old", "simbench==0.0", PYTHON), f"pytest-simbench 0.0, and this is {PLUGIN[10:]}"),
        (node("old", f"{PLUGIN[:-10]}0123456789", PYTHON), "pytest-simbench 0.1.0+0123456789, and"
         f" this is {PLUGIN[10:]}"),
        (node("old", PLUGIN, "python==2.7"), f"Python 2.7, and this is {PYTHON[8:]}"),
    ],
)  # fmt: skip
def test_other_versions_are_refused(stranger: Node, words: str) -> None:
    told = refusal([stranger, lab("lab1"), replace(stranger, name="b")])
    assert (
        told
        == f"old runs {words}; b runs {words}; install the same version and commit on both sides"
    )
    assert not stranger.has("mujoco", "headless")
    assert not refusal([lab("lab1")])
    assert refusal([]) == "it has no node; start one: simbench cluster node ADDRESS"


def test_a_head_and_a_node_that_are_told_little(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        serving, "_run", lambda serve, *told: [serve.func.__name__, serve.args, *told]
    )
    assert serving.head(None, None, None, False, True) == [
        "_head", ("127.0.0.1", 8786, module.LOST_AFTER, False, True),
        "the head cannot listen on 127.0.0.1:8786", "give another --host or --port",
    ]  # fmt: skip
    assert serving.head("h", 0, 2.5, True, False)[1] == ("h", 0, 2.5, True, False)
    assert serving.node("tcp://h:1", None, None, None, None) == [
        "_node", ("tcp://h:1", None, socket.gethostname(), 1, None),
        "no node for a head at tcp://h:1", "look at its address",
    ]  # fmt: skip
    own = ("tcp://h:1", "here", "vm", 4, ["mujoco"])
    assert serving.node(*own)[1] == own


class Client:
    """Dask's, as far as a pool asks it; the head says after which silence a node is lost."""

    told: ClassVar[dict[str, Any]] = {}

    def __init__(self, *where: Any, **how: Any) -> None:
        self.done: list[Any] = [(*where, how)]
        self.subscribe_topic = lambda *what: self.done.append(what)
        self.close = lambda **how: self.done.append(how)
        if "down" in where[0]:
            raise OSError("refused") from TimeoutError("no answer")

    def get_metadata(self, keys: list[str], default: Any) -> Any:
        return self.told if keys == [module.SETTINGS] else default

    def submit(self, *what: Any, **how: Any) -> None:
        self.done.append((*what, how))


def test_a_pool_joins_a_scheduler_and_sends_a_job_to_one_node(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[Any] = []
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(distributed, "Client", Client)
    monkeypatch.setattr(module, "check_security", lambda *role, **how: asked.append((role, how)))
    pools = [Pool("tcp://h:1")]
    monkeypatch.setattr(Client, "told", {"lost-after": 2})
    pools.append(Pool("TLS://h:1"))
    assert [pool.lost_after for pool in pools] == [module.LOST_AFTER, 2.0]
    assert asked == [(("client",), {"tls": tls}) for tls in (False, True)]
    how = {"timeout": 10.0, "set_as_default": False, "name": "pytest-simbench"}
    done: list[Any] = pools[1]._client.done
    assert done == [("TLS://h:1", how), (module.node_side.TOPIC, pools[1]._hear)]
    pools[1].submit("key", A, Packed.of(b"job"), 3)
    how = {"key": "key", "workers": [A.address], "pure": False, "retries": 0}
    assert done[2:] == [(module.node_side.run, Packed.of(b"job"), 3, how)]
    pools[1].close()
    assert done[3:] == [{"timeout": 5}]
    with pytest.raises(ExecutorError, match=r"answers at tcp://down .no answer.; start one: simb"):
        Pool("tcp://down")


class Told(Pool):
    """Knows what it is told, and asks no scheduler."""

    def __init__(self, nodes: Iterable[Node]) -> None:
        self._begin()
        self._known = {node.address: node for node in nodes}

    def _look(self) -> None:
        pass


A, B = lab("a", "mujoco==4.0"), lab("b", "mujoco==4.0")


def taken(pool: Pool, *avoid: str) -> str | None:
    """The name of the node that the next repetition gets."""
    found = pool.reserve(lambda node: node.has("mujoco", "headless"), avoid, threading.Event())
    return None if found is None else found[1].name


def test_one_repetition_for_each_slot() -> None:
    pool = Told([A, B])
    assert {taken(pool), taken(pool)} == {"a", "b"}
    soon = threading.Timer(0.3, lambda: pool.release(next(iter(pool._mine))))
    soon.start()
    assert taken(pool) in ("a", "b")  # once one is free
    soon.join()
    shared = Told([A, B])
    shared._others = {A.address: A.slots}  # of another run
    assert taken(shared) == "b"


def test_what_is_tried_again_goes_elsewhere_where_it_can() -> None:
    for avoid, other in (("a", "b"), ("b", "a")):
        assert taken(Told([A, B]), avoid) == other
    assert taken(Told([A]), "a") == "a"


def test_a_node_that_was_given_up_gets_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PATIENCE", 0.5)
    pool = Told([A, lab("c", "drake==1.51")])
    pool.give_up(A)
    assert taken(pool) is None  # nobody else offers it


def test_a_node_that_joins_with_another_version_is_left_out_and_told(case: Case) -> None:
    told: list[str] = []
    executor = ClusterExecutor(Told([A]), told.append)
    repetition = executor.repetition(Experiment(case, Falling()), 1)
    assert [repetition._able(node) for node in (A, lab("c", "mujoco==9.9"))] == [True, False]
    assert told == ["c got no repetition: mujoco is 9.9 there, 4.0 here"]
    assert not repetition._able(node("late", "simbench==0.2", PYTHON, "mujoco==4.0"))
    assert told[1].startswith(
        "late got no repetition: it runs pytest-simbench 0.2, and this is 0.1"
    )


class Asked(Pool):
    """Asks a scheduler that is written down, of the nodes a, and b and c without a simulator."""

    def __init__(self) -> None:
        self._begin()
        self.address, self.lost_after = "tcp://head", 5.0
        self.heard = dict.fromkeys("abc", 1.0)
        self.busy: dict[str, list[str]] = {}
        self._client = SimpleNamespace(  # type: ignore[assignment]
            status="running", scheduler_info=self.info, processing=lambda: self.busy
        )

    def info(self, n_workers: int) -> Any:
        offers = {"a": [PLUGIN, "simbench", "mujoco==4.0"], "b": ["simbench"], "c": ["GPU"]}
        told = {
            f"tcp://{k}:1": {"name": k, "resources": dict.fromkeys(offers[k], 2.0), "last_seen": at}
            for k, at in self.heard.items()
        }
        return {"workers": told if n_workers == -1 else {}}


def test_nodes_are_those_that_the_scheduler_has_heard_of(monkeypatch: pytest.MonkeyPatch) -> None:
    """By this machine's clock; what is known stays so for a moment."""
    now = [100.0]
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now[0]))
    pool = Asked()
    a, b = pool.nodes()
    assert (a.name, a.slots, b.name, pool.began["mujoco"]) == ("a", 2, "b", "4.0")
    pool._mine = {"k1": a.address}
    pool.busy = {a.address: ["k1", "k2", "k3"], b.address: []}
    now[0] += module.LOOK_PERIOD / 2
    assert (pool.nodes(), pool._others) == ((a, b), {})
    now[0] += module.LOOK_PERIOD
    pool.heard["a"] = 2.0
    assert (pool.nodes(), pool._others) == ((a, b), {a.address: 2, b.address: 0})
    assert [pool._free(node) for node in (a, b)] == [-1, 2]
    now[0] = 105.0  # b was heard of at 100
    assert pool.lives(b)
    now[0] = 105.3
    assert (pool.lives(a), pool.lives(b), pool.nodes()) == (True, False, (a,))
    pool.heard |= {"a": 3.0, "b": 2.0}
    now[0] = 105.6
    assert pool.nodes() == (a, b)
    pool.give_up(b)
    now[0] = 106.0
    assert pool.nodes() == (a,)
    del pool.heard["b"]
    now[0] = 107.0
    assert pool.nodes() == (a,)
    assert {*pool._seen} == {"tcp://a:1", "tcp://c:1"}
    pool.began = {"mujoco": "3.0"}  # stays, whoever comes
    now[0] = 108.0
    assert (pool.nodes(), pool.began) == ((a,), {"mujoco": "3.0"})

    def fails(n_workers: int) -> None:
        raise OSError("broken pipe")

    pool._client.scheduler_info = fails
    now[0] = 109.0
    with pytest.raises(ExecutorError, match=r"^the scheduler at tcp://head is gone .broken pipe.;"):
        pool.nodes()
    pool._client.status = "closed"
    with pytest.raises(ExecutorError, match="^the scheduler at tcp://head is gone; the records so"):
        pool.nodes()


def test_progress_is_that_of_jobs_under_way_and_ends_with_them() -> None:
    pool = Told([A])
    pool._mine = {"mine": A.address}
    for key in ("mine", "other"):
        pool._hear((1.0, {"key": key, "done": 3}))
    assert (pool.progress("mine"), pool.progress("other")) == ({"key": "mine", "done": 3}, {})
    ended: list[Any] = []
    for done in (False, True):
        future: Any = SimpleNamespace(done=lambda d=done: d, cancel=lambda **how: ended.append(how))
        pool.release("mine", future)
    assert (pool.progress("mine"), pool._mine) == ({}, {})
    assert ended == [{"reason": "nobody waits for it any more", "force": True}]


def test_waiting_ends_when_the_run_does() -> None:
    pool, stop = Told([]), threading.Event()
    threading.Timer(0.3, stop.set).start()
    assert pool.reserve(lambda node: True, (), stop) is None


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("head --port {}", "127.0.0.1:{} ([Errno 98] Address already in use); give another --host"),
        ("head --tls", "tls:// needs certificates for the scheduler in Dask's configuration"),
        ("node tls://h:1", "tls:// needs certificates for the worker in Dask's configuration"),
        ("node tcp://nosuch.invalid:1", "no node for a head at tcp://nosuch.invalid:1 ("),
    ],
)
def test_what_cannot_begin_says_so(
    words: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert main(["cluster", *words.format(port).split()]) == 2
    assert told.format(port) in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("head", "configuration here asks for encryption; start the head with --tls, and write"),
        ("node tls://h:1", "cannot be read (/none/ca, /none/worker, None): FileNotFoundError"),
    ],
)
def test_security_that_cannot_be_says_so(
    words: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    dask = pytest.importorskip("dask")
    comm = "distributed.comm."
    files = {f"{comm}tls.ca-file": "/none/ca", f"{comm}tls.worker.cert": "/none/worker"}
    with dask.config.set({f"{comm}require-encryption": True, **files}):
        assert main(["cluster", *words.split()]) == 2
    assert told in capsys.readouterr().err


def test_a_node_that_looks_for_its_head_ends_when_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Dask looks for half a minute."""

    def soon() -> asyncio.Event:
        told = asyncio.Event()
        asyncio.get_running_loop().call_later(0.5, told.set)
        return told

    monkeypatch.setattr("pytest_simbench.cluster.serving._told", soon)
    began = time.monotonic()
    assert main(["cluster", "node", "tcp://127.0.0.1:1", "--sim", "mujoco"]) == 0
    assert time.monotonic() - began < 20


def test_a_node_whose_name_is_taken_is_told_to_take_another() -> None:
    for why in ("Worker failed to start.", "Unexpected response: {'message': 'name taken, vm'}"):
        error = RuntimeError("Nanny failed to start.")
        error.__cause__ = RuntimeError(why)
        assert not_taken("tcp://head:8786", "vm", error) == (
            f"no head at tcp://head:8786 takes this node ({why}); if Dask says above that the "
            "name 'vm' is taken, give another --name"
        )
    away = not_taken("tcp://head:8786", "vm", OSError("Timed out"))
    assert away == f"no head at tcp://head:8786 takes this node (Timed out); {TLS}"
    assert reason(OSError()) == "OSError"  # Dask's may say nothing
