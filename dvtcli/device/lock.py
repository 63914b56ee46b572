"""One writer a node: a lock between dvtcli processes, released by the system when its holder ends, however it ends."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from dvtcli.device.journal import file_name
from dvtcli.errors import SafetyRefusal


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

    def take(self) -> None:
        """Take the lock; SafetyRefusal where another dvtcli holds it."""
        if self._file is not None:
            return
        self.folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        file = self.path.open("ab+")
        try:
            _lock(file)
        except OSError as held:
            file.seek(0)
            holder = file.read(20).decode("ascii", "replace").strip() or "?"
            file.close()
            raise SafetyRefusal(
                f"another dvtcli (process {holder}) is changing node {self.node_id} on {self.bus}",
                node=self.node_id,
                hint="leave it, or wait until it has finished",
            ) from held
        file.truncate(0)
        file.write(str(os.getpid()).encode())
        file.flush()
        self._file = file

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


def _lock(file: IO[bytes]) -> None:
    """Lock the whole file without waiting; OSError where somebody else has it."""
    if sys.platform == "win32":
        import msvcrt

        file.seek(0x7FFF_0000)  # far behind the text, which others must be able to read
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
