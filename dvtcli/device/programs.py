"""A device's programs (CiA 302-3): objects, status, and notes on disk about a download in progress."""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import Enum
from pathlib import Path
from typing import NamedTuple

from dvtcli.device.change.private_file import file_name, remove, sync_folder, write_private

#: commands to the program control; it reads back the last accepted command
STOP, START, CLEAR = 0, 1, 3
_FLASH_ERRORS = {
    1: "no valid program",
    2: "data format unknown",
    3: "data format error or wrong CRC",
    4: "flash not cleared before the download",
    5: "flash write error",
    6: "address error",
    7: "flash secured",
}


class FlashStatus(NamedTuple):
    """The flash status object (u32): bit 0 at work, bits 1..7 the last error; other bits are manufacturer-specific."""

    raw: int

    @property
    def is_at_work(self) -> bool:
        """Whether the flash memory is being cleared or written."""
        return bool(self.raw & 1)

    @property
    def error(self) -> str:
        """Error text, empty for no error."""
        code = self.raw >> 1 & 0x7F
        return _FLASH_ERRORS.get(code, f"error {code}") + f" (0x{self.raw:08X})" if code else ""


class Stage(Enum):
    """Progress of a program download; the value describes the device's program if it ends there."""

    STOPPING = "the old firmware, which may be stopped"
    CLEARING = "the old firmware or none: the clear command was sent"
    LOADING = (
        "no firmware that is known to be complete: the old one is cleared, the new one was being downloaded or written"
    )
    CHECKING = "a program that was loaded and not started"
    STARTING = "the new program; whether it runs is not known"


SCHEMA = "dvtcli.program_download/1"
_MOST_BYTES = 10_000


@dataclass(frozen=True, slots=True)
class ProgramNotes:
    """The notes of the nodes on the bus called *bus*, in *folder*."""

    folder: Path
    bus: str

    def _path(self, node_id: int) -> Path:
        return self.folder / f"{file_name(self.bus)}-{node_id}.json"

    def write(self, node_id: int, file: str, number: int, stage: Stage) -> None:
        """Note that *file*, for program *number* of *node_id*, has reached *stage*. Raises OSError."""
        now = datetime.now(UTC).isoformat(timespec="seconds")
        document = {"schema": SCHEMA, "bus": self.bus, "node": node_id, "file": file, "program": number}
        write_private(self._path(node_id), json.dumps({**document, "stage": stage.name, "when": now}) + "\n")

    def forget(self, node_id: int) -> bool:
        """Remove the note of a download; true if there was one."""
        path = self._path(node_id)
        was_there = path.exists()
        remove(path)
        if was_there:
            sync_folder(self.folder)
        return was_there

    def unfinished_text(self, node_id: int) -> str:
        """The message about an incomplete download; empty if there is none."""
        try:
            with self._path(node_id).open("rb") as opened:
                document = json.loads(opened.read(_MOST_BYTES))
            stage, file = Stage[document["stage"]], str(document["file"])
            text = f"the download of {file} into node {node_id} was not completed ({document['when']}): it holds "
        except (FileNotFoundError, NotADirectoryError):
            return ""
        except (OSError, ValueError, KeyError, TypeError):
            return f"a program download into node {node_id} was not completed: {_NEXT}"
        return f"{text}{stage.value}; {_NEXT}"


_NEXT = "download the firmware again, or forget the interrupted download if the device is all right"
