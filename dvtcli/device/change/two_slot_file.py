"""A file with two slots: new content replaces the older one, so that a kill or a full disk leaves one complete.

Each slot is a line of fixed length: a checksum, a number that grows, and the content. The newest valid line counts.
"""

from __future__ import annotations

import errno
import os
import re
import zlib
from pathlib import Path

from dvtcli.device.change.private_file import open_private, to_disk, write_private

#: the checksum (CRC-32), the number, and a space behind each
_HEAD = re.compile(rb"([0-9a-f]{8}) ([0-9]{10}) ")
HEAD_BYTES = 20
#: what a disk that takes nothing more says
_FULL = (errno.ENOSPC, errno.EDQUOT)


def create_two_slot_file(path: Path, content: str, size: int) -> None:
    """Write a new file of *content* (ASCII) with space for *size* bytes, synced to disk on return.

    Raises OSError and SafetyRefusal like `write_private`; an existing file of the same name stays unchanged then.
    """
    size = max(size, len(content))
    write_private(path, _line(content, 1, size) + " " * (size + HEAD_BYTES) + "\n", newline="\n")


def replace_content(path: Path, content: str, room: int = 0) -> bool:
    """Replace the content (ASCII) of the file at *path* without using more space; false if too little is reserved.

    *room* is how many further bytes to reserve. Raises OSError if the disk refuses all the same, as a copy-on-write
    file system may; the content stays unchanged then.
    """
    try:
        descriptor = open_private(path, os.O_RDWR)
    except FileNotFoundError:
        return False
    with os.fdopen(descriptor, "rb+", buffering=0) as file:
        lines = file.read().splitlines(keepends=True)
        is_ours = len(lines) == 2 and len(lines[0]) == len(lines[1])
        size = len(lines[0]) - HEAD_BYTES - 1 if is_ours else -1
        if len(content) + room > size:
            return False
        numbers = [_number(line) for line in lines]
        file.seek(numbers.index(min(numbers)) * len(lines[0]))
        try:
            left = memoryview(_line(content, max(numbers) + 1, size).encode())
            while left:
                left = left[file.write(left) :]
            to_disk(file.fileno())
        except OSError as failed:
            if failed.errno not in _FULL:
                raise
            why = f"{failed.strerror} for what has its space: this file system copies on write"
            raise OSError(failed.errno, why, str(path)) from failed
    return True


def content_of(data: bytes) -> bytes:
    """The content of a file with the bytes *data*; *data* unchanged if not in this format.

    Raises ValueError if no line is valid.
    """
    if not _HEAD.match(data):
        return data
    newest = max(data.split(b"\n")[:2], key=_number)
    if not _number(newest):
        raise ValueError("it was not written to its end")
    return newest[HEAD_BYTES:]


def _line(content: str, number: int, size: int) -> str:
    numbered = f"{number:010d} {content:{size}}"
    return f"{zlib.crc32(numbered.encode()):08x} {numbered}\n"


def _number(line: bytes) -> int:
    """The number of a valid *line*, else 0."""
    head, line = _HEAD.match(line), line.rstrip(b"\n")
    return int(head[2]) if head and int(head[1], 16) == zlib.crc32(line[9:]) else 0
