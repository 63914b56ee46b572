"""Notes on disk about a program download in progress, to inform the next user after a kill.

One file per node, from before the first write until the new program runs.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from dvtcli.device.change.private_file import file_name, remove, sync_folder, write_private
from dvtcli.domain.program import Stage

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

    def told(self, node_id: int) -> str:
        """The message about an incomplete download; empty if there is none."""
        try:
            with self._path(node_id).open("rb") as opened:
                document = json.loads(opened.read(_MOST_BYTES))
            stage, file = Stage[document["stage"]], str(document["file"])
            said = f"the download of {file} into node {node_id} was not completed ({document['when']}): it holds "
        except (FileNotFoundError, NotADirectoryError):
            return ""
        except (OSError, ValueError, KeyError, TypeError):
            return f"a program download into node {node_id} was not completed: {_NEXT}"
        return f"{said}{stage.value}; {_NEXT}"


_NEXT = "download the firmware again, or forget the interrupted download if the device is all right"
