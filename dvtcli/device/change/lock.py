"""One writer a node: a lock between dvtcli processes, released by the system when its holder ends, however it ends.

Its file and folder are the user's alone: what others could write, or lead elsewhere by a link, is refused (`trust`).
"""

from __future__ import annotations

import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from dvtcli.device.change.journal import file_name
from dvtcli.device.trust import check_folder, open_private, private_folder
from dvtcli.errors import SafetyRefusal

#: a process number and a path
_MOST_BYTES = 20_000


@dataclass(slots=True)
class NodeLock:
    """The right to write to *node_id* on the bus called *bus*; *folder* holds one file for each."""

    folder: Path
    bus: str
    node_id: int
    _file: IO[bytes] | None = None

    @property
    def path(self) -> Path:
        """The lock's file; it stays, the lock on it does not."""
        return self.folder / f"{file_name(self.bus)}-{self.node_id}.lock"

    @property
    def held(self) -> bool:
        """Whether it is ours."""
        return self._file is not None

    def take(self) -> None:
        """Take the lock; SafetyRefusal where another dvtcli holds it, or others can write where it is kept."""
        if self._file is not None:
            return
        private_folder(self.folder.parent)
        private_folder(self.folder)
        descriptor = open_private(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND)
        # unbuffered: what a full disk refuses is refused once, not again at the end
        file = os.fdopen(descriptor, "ab+", buffering=0)
        try:
            _lock_soon(file)
        except OSError as held:
            holder = self._lines()[0] or "?"
            file.close()
            raise SafetyRefusal(
                f"another dvtcli (process {holder}) is changing node {self.node_id} on {self.bus}",
                node=self.node_id,
                hint="leave it, or wait until it has finished",
            ) from held
        self._file = file
        self.note(self.noted())

    def note(self, journal: Path | None) -> None:
        """Write down, beside the holder, where the journal of the change in hand is; it outlives a killed holder."""
        assert self._file is not None  # noqa: S101 - only the holder writes
        self._file.truncate(0)
        self._file.write(f"{os.getpid()}\n{journal or ''}\n".encode())
        self._file.flush()
        os.fsync(self._file.fileno())

    def noted(self) -> Path | None:
        """The journal that the last holder noted, or None."""
        line = self._lines()[1]
        return Path(line) if line else None

    def _lines(self) -> tuple[str, str]:
        """Holder and journal as the file says; empty where it does not."""
        check_folder(self.folder.parent)
        check_folder(self.folder)
        try:
            with os.fdopen(open_private(self.path, os.O_RDONLY), "rb") as file:
                text = file.read(_MOST_BYTES).decode("utf-8", "replace")
        except FileNotFoundError:
            text = ""
        holder, _, rest = text.partition("\n")
        return holder.strip()[:20], rest.partition("\n")[0].strip()

    def is_free(self) -> bool:
        """Whether nobody else is writing right now."""
        if self._file is not None:
            return True
        try:
            self.take()
        except SafetyRefusal:
            return False
        self.release()
        return True

    def release(self) -> None:
        """Let others write."""
        if self._file is not None:
            self._file.close()
            self._file = None


def _lock_soon(file: IO[bytes]) -> None:
    """Lock the file; another dvtcli that only looks holds it for less than a moment."""
    for wait_s in (0.01, 0.03, 0.06):
        try:
            _lock(file)
        except OSError:
            time.sleep(wait_s)
        else:
            return
    _lock(file)


def _lock(file: IO[bytes]) -> None:
    """Lock the whole file without waiting; OSError where somebody else has it."""
    if sys.platform == "win32":
        import msvcrt

        file.seek(0x7FFF_0000)  # far behind the text, which others must be able to read
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
