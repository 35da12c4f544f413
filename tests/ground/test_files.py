"""Files of anybody: read whole, of a bounded size, and never as code."""

from __future__ import annotations

import io
import json
import os
import pickle
import select
import zipfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.ground import files
from pytest_simbench.ground.files import FileError, read_arrays, read_file, read_json


def test_a_file_is_read_up_to_a_size(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"12345")
    assert read_file(path, 5) == b"12345"
    with pytest.raises(FileError, match="cannot read the file .*/a: it is larger than"):
        read_file(path, 4)


@pytest.mark.parametrize(
    ("name", "said"),
    [("pipe", "a pipe"), (".", "a folder"), ("/dev/zero", "a device"), ("none", "No such file"),
     ("nul\0", "null byte"), ("x" * 300, "File name too long"), ("loop", "Too many levels")],
)  # fmt: skip
def test_what_is_no_file(tmp_path: Path, name: str, said: str) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(FileError, match=f"cannot read the thing .*{said}"):
        read_file(f"{tmp_path}/{name}" if name[0] != "/" else name, 100, "the thing")


def test_what_has_no_kind_is_no_file(tmp_path: Path) -> None:
    with select.epoll() as poll:
        (tmp_path / "poll").symlink_to(f"/proc/self/fd/{poll.fileno()}")
        with pytest.raises(FileError, match="it is no file$"):
            read_file(tmp_path / "poll", 100)


def test_a_file_of_unknown_length_is_bounded_too() -> None:
    with pytest.raises(FileError, match="larger than"):
        read_file("/proc/self/status", 10)  # says that it has no bytes


def test_what_takes_the_place_of_a_file_that_was_looked_at_is_no_trap(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pipe is not waited for, and of what is endless no more is read than it takes to tell."""
    (tmp_path / "a").write_bytes(b"12345")
    os.mkfifo(tmp_path / "pipe")
    looked, flags, sizes = os.stat(tmp_path / "a"), list[int](), list[int]()

    def opened(path: Path, how: int) -> int:
        flags.append(how)
        return os.open(path, how | os.O_NONBLOCK)

    class Endless(io.BytesIO):
        fileno = staticmethod(lambda: 0)

        def read(self, size: int | None = None) -> bytes:
            sizes.append(size or 0)
            return b"x" * (size or 0)

    told = {"stat": lambda path: looked, "open": opened}
    monkeypatch.setattr(files, "os", SimpleNamespace(**{**vars(os), **told}))
    with pytest.raises(FileError, match="it is a pipe"):
        read_file(tmp_path / "pipe", 5)
    assert flags == [os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC]
    monkeypatch.setattr(files.os, "fstat", lambda number: looked)
    monkeypatch.setattr(
        files, "open", lambda number, mode: Endless(os.close(number)), raising=False
    )
    with pytest.raises(FileError, match="larger than"):
        read_file(tmp_path / "a", 5)
    assert sizes == [6]


@given(st.recursive(st.none() | st.booleans() | st.integers() | st.text()
                    | st.floats(allow_nan=False, allow_infinity=False), st.lists))  # fmt: skip
def test_json_is_read(data: object) -> None:
    assert read_json(json.dumps(data)) == data


@pytest.mark.parametrize(
    "text", ["NaN", "[Infinity]", "-Infinity", "1e999", "[" * 99999, "", "\x00"]
)
def test_json_that_is_none(text: str) -> None:
    with pytest.raises(ValueError, match=r"finite|deeply|Expecting"):
        read_json(text)


def test_arrays_are_read(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "a.npz", x=np.arange(3.0), names=["a", "b"])
    found = read_arrays(tmp_path / "a.npz", 10_000)
    assert found["x"].tolist() == [0, 1, 2]
    assert found["names"].tolist() == ["a", "b"]
    np.savez_compressed(tmp_path / "b.npz", x=np.zeros(10_000))
    size = 80_000 + 128  # with the header of a .npy file
    assert len(read_arrays(tmp_path / "b.npz", size)["x"]) == 10_000
    with pytest.raises(FileError, match="cannot read the arrays in .*b.npz: it is larger than"):
        read_arrays(tmp_path / "b.npz", size - 1)


class Evil:
    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.mkdir, ("executed",)


HUGE = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000000,), }"
"""Header of an array of 8 PB."""


def packed(name: str, content: bytes) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, content)
    return data.getvalue()


def test_what_is_no_array_is_never_carried_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    np.savez(tmp_path / "object.npz", x=np.array([Evil()], dtype=object))
    contents = {
        "pickle": pickle.dumps(Evil()),
        "empty": b"",
        "text": b"nothing",
        "cut": (tmp_path / "object.npz").read_bytes()[:-30],
        "pickled": packed("x.npy", pickle.dumps(Evil())),
        "other": packed("x.txt", b"text"),
        "bomb": packed("x.npy", b"\0" * 50_000_000),
        "huge": packed("x.npy", b"\x93NUMPY\x01\x00v\x00" + HUGE.ljust(118)),
    }  # fmt: skip
    for name, content in contents.items():
        (tmp_path / f"{name}.npz").write_bytes(content)
    for name in ("object", *contents):
        with pytest.raises(FileError, match=f"{name}.npz"):
            read_arrays(tmp_path / f"{name}.npz", 10_000_000)
    assert not (tmp_path / "executed").exists()
