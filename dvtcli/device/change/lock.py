"""One writer per node: a lock between dvtcli processes, released by the operating system when its holder ends.

File and folder must be writable by the user only; a file others could write or replace by a link is refused (`trust`).
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, NamedTuple

from dvtcli.device.change.private_file import check_folder, file_name, open_private, private_folder, to_disk
from dvtcli.errors import SafetyRefusal

#: two holders and a path
_MOST_BYTES = 20_000
#: How long another dvtcli is waited for, whose change may be over in a moment (s).
WAIT_S = 1.0
#: How long one that only looks may hold the lock, with much to spare (s).
LOOK_S = 0.1
_RETRY_S = 0.01


@dataclass(frozen=True, slots=True)
class LockHolder:
    """The present or last holder of the lock: *process*, *since* (ISO 8601, UTC) and *command*."""

    process: str
    since: str = ""
    command: str = ""

    def __str__(self) -> str:
        ran = f"`{self.command}`, " if self.command else ""
        return f"process {self.process}, {ran}{self.since[11:19] or '?'} UTC"


class _LockNote(NamedTuple):
    """The content of the lock file: present or last holder, journal in progress, and last writer."""

    holder: LockHolder
    journal: str = ""
    writer: LockHolder | None = None

    def text(self) -> str:
        rows = [self.holder.process, self.journal, self.holder.since, self.holder.command]
        if self.writer is not None:
            rows += [self.writer.process, self.writer.since, self.writer.command]
        return "".join(f"{row}\n" for row in rows)

    @classmethod
    def parse(cls, text: str) -> _LockNote:
        """Parse the lock file's *text*; an empty file gives an empty note."""
        process, journal, since, command, *writer = ([row.strip() for row in text.split("\n")] + [""] * 7)[:7]
        return cls(_holder(process, since, command), journal, _holder(*writer) if writer[0] else None)


def _holder(process: str, since: str, command: str) -> LockHolder:
    return LockHolder(process[:20], since[:40], command[:80])


@dataclass(slots=True, eq=False, repr=False)
class NodeLock:
    """The right to write to *node_id* on the bus called *bus*; *folder* has a file for each.

    *command* describes this process for other users refused meanwhile.
    """

    folder: Path
    bus: str
    node_id: int
    command: Callable[[], str] = lambda: ""
    #: called after the lock is taken
    on_taken: Callable[[], None] = lambda: None
    #: another dvtcli that wrote after we released the lock
    meanwhile: LockHolder | None = None
    _file: IO[bytes] | None = None
    _own: LockHolder = LockHolder("")
    _last_writer: LockHolder | None = None
    _was_held: bool = False
    #: our note in the lock file
    _on_disk: bytes = b""

    @property
    def path(self) -> Path:
        """The lock file; the file stays after the lock is released."""
        return self.folder / f"{file_name(self.bus)}-{self.node_id}.lock"

    @property
    def held(self) -> bool:
        """True if this process holds the lock."""
        return self._file is not None

    def take(self, wait_s: float = WAIT_S) -> None:
        """Take the lock, waiting up to *wait_s* seconds for another holder.

        Raises SafetyRefusal if another dvtcli holds the lock, or other users can write to the folder.
        """
        if self._file is not None:
            return
        try:
            private_folder(self.folder.parent, is_shared=True)
            private_folder(self.folder, is_shared=True)
            descriptor = open_private(self.path, os.O_RDWR | os.O_CREAT)
        except OSError as failed:
            raise self._named(failed) from failed
        # unbuffered: what a full disk refuses is refused once, not again at the end
        file = os.fdopen(descriptor, "rb+", buffering=0)
        try:
            lock_within(file, wait_s)
        except BaseException as stopped:
            file.close()
            if isinstance(stopped, OSError):
                raise self._refusal(wait_s) from stopped
            raise
        self._file, self._on_disk = file, b""
        self._own = LockHolder(str(os.getpid()), datetime.now(UTC).isoformat(), " ".join(self.command().split())[:80])
        try:
            self._look_back()
            self.note(self.noted())
            self.on_taken()
        except BaseException:
            self.release()
            raise

    def _refusal(self, wait_s: float) -> SafetyRefusal:
        holder = self._read().holder
        process, ran = holder.process or "?", f"its `{holder.command}`" if holder.command else "it"
        since = f" since {holder.since[11:19]} UTC" if holder.since else ""
        return SafetyRefusal(
            f"another dvtcli (process {process}) is changing node {self.node_id} on {self.bus}",
            node=self.node_id,
            why=f"{ran} holds the node's lock{since}, and was waited for {wait_s:g} s",
            hint=f"try again when it has finished; if it hangs, end process {process}, which rolls its change back",
        )

    def _look_back(self) -> None:
        """Find out whether another dvtcli wrote since we held the lock."""
        writer = self._read().writer
        if self._was_held and writer != self._last_writer:
            self.meanwhile = writer
        self._was_held, self._last_writer = True, writer

    def note(self, journal: Path | None) -> None:
        """Note the path of the journal in progress in the lock file, for other processes if this one is killed."""
        assert self._file is not None  # noqa: S101 - only the holder writes
        if journal != self.noted():  # a change begins, or one is rolled back
            self._last_writer = self._own
        text = _LockNote(self._own, str(journal or ""), self._last_writer).text().encode()
        if text != self._on_disk:  # each part of a change says the same, and the disk takes its time
            self._on_disk = b""
            try:
                _write_over(self._file, text)
                to_disk(self._file.fileno())
            except OSError as failed:
                raise self._named(failed) from failed
            self._on_disk = text

    def _named(self, failed: OSError) -> OSError:
        """*failed* with the path of the lock file, whose folder is not the journals' folder."""
        return OSError(failed.errno, failed.strerror or str(failed), str(self.path))

    def noted(self) -> Path | None:
        """The journal noted by the last holder, or None."""
        line = self._read().journal
        return Path(line) if line else None

    def _read(self) -> _LockNote:
        """The content of the lock file; empty without a file."""
        check_folder(self.folder.parent, is_shared=True)
        check_folder(self.folder, is_shared=True)
        try:
            with os.fdopen(open_private(self.path, os.O_RDONLY), "rb") as file:
                return _LockNote.parse(file.read(_MOST_BYTES).decode("utf-8", "replace"))
        except (FileNotFoundError, NotADirectoryError):
            return _LockNote(LockHolder(""))

    def is_free(self) -> bool:
        """True if nobody else is writing now. Writes nothing, so a full disk or an obstructing file does not matter.

        Raises SafetyRefusal if other users can write to the lock's folder.
        """
        if self._file is not None:
            return True
        try:
            check_folder(self.folder.parent, is_shared=True)
            check_folder(self.folder, is_shared=True)
            file = os.fdopen(open_private(self.path, os.O_RDWR), "rb+", buffering=0)
        except (FileNotFoundError, NotADirectoryError):
            return True
        with file:
            try:
                lock_within(file, LOOK_S)
            except OSError:
                return False
            self._look_back()
        return True

    def release(self) -> None:
        """Release the lock."""
        if self._file is not None:
            self._file.close()
            self._file = None


def _write_over(file: IO[bytes], text: bytes) -> None:
    """Replace the content of *file* by *text*. Raises OSError, with the old content kept, if the disk is full."""
    file.seek(0)
    old = file.read()
    try:
        _write_all(file, text)
    except OSError:
        _write_all(file, old)  # overwritten in place, possible on a full disk
        raise


def _write_all(file: IO[bytes], text: bytes) -> None:
    file.seek(0)
    left = memoryview(text)
    while left:  # a disk filling up takes only a part
        left = left[file.write(left) :]
    file.truncate(len(text))


def lock_within(file: IO[bytes], wait_s: float) -> None:
    """Lock the file. Raises OSError if another process still holds the lock after *wait_s* seconds."""
    deadline_s = time.monotonic() + wait_s
    while time.monotonic() < deadline_s:
        try:
            _lock(file)
        except OSError:
            time.sleep(_RETRY_S)
        else:
            return
    _lock(file)


def _lock(file: IO[bytes]) -> None:
    """Lock the whole file without waiting. Raises OSError if another process holds the lock."""
    if sys.platform == "win32":
        import msvcrt

        file.seek(0x7FFF_0000)  # far behind the text, which others must be able to read
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
