"""Which files below a folder are opened: counted, since a time would depend on the machine.

The kernel tells it. An audit hook would stay in the process for good, and while a line of it runs between two steps of
`sys.settrace` no other thread can begin to be measured. Does not know by which process a file is opened.
"""

from __future__ import annotations

import ctypes
import os
import struct
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

#: inotify(7): a file was opened (of a folder another bit is set too), it was closed, something is lost. What is told
#: twice in a row is told once: between two openings the closing has to be told
_OPENED, _CLOSED, _LOST = 0x0020, 0x0018, 0x4000
#: the head of what is told
_HEAD = struct.Struct("iIII")


@contextmanager
def opened_files(below: Path) -> Iterator[list[str]]:
    """The files below a folder that are opened in the block, by their names, each as often as it is opened.

    Those in folders that are made in the block are not told.
    """
    if sys.platform != "linux":
        pytest.skip("only Linux tells which files are opened")
    library, found = ctypes.CDLL(None, use_errno=True), list[str]()
    told = library.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        for folder in (below, *(path for path in below.rglob("*") if path.is_dir())):
            watched = library.inotify_add_watch(told, os.fsencode(folder), _OPENED | _CLOSED)
            assert watched >= 0, os.strerror(ctypes.get_errno())
        yield found
        found += _names(told)
    finally:
        os.close(told)


def _names(told: int) -> Iterator[str]:
    while True:
        try:
            events = os.read(told, 1 << 16)
        except BlockingIOError:
            return
        while events:
            _folder, mask, _cookie, length = _HEAD.unpack_from(events)
            assert mask != _LOST, "the kernel could not keep them all"
            name, events = events[_HEAD.size : _HEAD.size + length], events[_HEAD.size + length :]
            if mask == _OPENED:
                yield os.fsdecode(name.rstrip(b"\0"))
