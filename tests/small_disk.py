"""A disk of a few pages that fills up before a file operation of the test's choice: a tmpfs in a process of its own."""

from __future__ import annotations

import ctypes
import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from tests.operations.network.killed import in_own_process

_CLONE_NEWNS, _CLONE_NEWUSER, _MS_REC, _MS_PRIVATE = 0x0002_0000, 0x1000_0000, 0x4000, 0x4_0000
_CANNOT = "cannot mount"
_listeners: list[Callable[[Path], None]] = []


def on_small_disk(disk: Path, act: Callable[[], None], *, size: int = 4_000_000, inodes: int = 400) -> str:
    """What went wrong in *act*, which has a disk of *size* bytes and so many *inodes* at *disk*.

    Skips the test where no file system can be mounted: that takes root, or a user namespace.
    """
    if sys.platform != "linux":
        pytest.skip("no tmpfs: only Linux has it")

    def mounted() -> None:
        try:
            _mount(disk, f"size={size},nr_inodes={inodes},mode=700")
        except OSError as failed:
            raise RuntimeError(f"{_CANNOT}: {failed}") from failed
        threading.settrace(None)
        sys.settrace(None)
        sys.addaudithook(_received)
        act()

    disk.mkdir(parents=True, exist_ok=True)
    wrong = in_own_process(disk.parent / "what went wrong", mounted)
    if _CANNOT in wrong:
        pytest.skip(f"no small disk can be mounted here (root or a user namespace can): {wrong.splitlines()[-1]}")
    return wrong


def _mount(folder: Path, options: str) -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    user, group = os.geteuid(), os.getegid()

    def call(done: int) -> None:
        if done:
            raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))

    call(libc.unshare(_CLONE_NEWNS | (_CLONE_NEWUSER if user else 0)))
    if user:
        for name, text in (("setgroups", "deny"), ("uid_map", f"0 {user} 1"), ("gid_map", f"0 {group} 1")):
            Path(f"/proc/self/{name}").write_text(text)
    call(libc.mount(b"none", b"/", None, _MS_REC | _MS_PRIVATE, None))
    call(libc.mount(b"tmpfs", os.fsencode(folder), b"tmpfs", 0, options.encode()))


def fill(disk: Path) -> None:
    """Let *disk* take nothing more: no byte, and no name."""
    with suppress(OSError), (disk / "filler").open("wb", buffering=0) as file:
        while file.write(bytes(4096)):
            pass
    with suppress(OSError):
        for number in range(10_000):
            (disk / f"filler{number}").touch()


def empty(disk: Path) -> None:
    """Take away what filled *disk*."""
    for path in disk.glob("filler*"):
        path.unlink()


@contextmanager
def filled_at(disk: Path, number: int) -> Iterator[list[str]]:
    """Fill *disk* before the file operation of this *number* on it (0: never); the names of the files so far.

    An operation is that a file is opened to be written, made, renamed or removed.
    """
    names: list[str] = []

    def received(path: Path) -> None:
        names.append(path.name)
        if len(names) == number:
            _listeners.clear()
            fill(disk)
            _listeners.append(received)

    _listeners.append(lambda path: received(path) if disk in path.parents else None)
    try:
        yield names
    finally:
        _listeners.clear()


def _received(event: str, arguments: tuple[Any, ...]) -> None:
    if not _listeners or not isinstance(arguments[0] if arguments else None, str | bytes | os.PathLike):
        return
    writes = event == "open" and isinstance(arguments[2], int) and arguments[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)
    if writes or event in ("os.rename", "os.remove", "os.mkdir"):
        _listeners[-1](Path(os.fsdecode(arguments[0])))
