"""Find the automatic backups of a node: scripts that set every PDO to its former configuration."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from dvtcli.device.change.private_file import file_name
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import PdoChange, plan_pdo
from dvtcli.domain.script_line import REMARKS, identity_line, serial_line


class Backup(NamedTuple):
    """A backup file with its time stamp in UTC, like `20261122T041120.123456Z`."""

    path: Path
    stamp: str

    def was_made(self, when: str) -> bool:
        """True if the time stamp starts with *when*: a date with or without a time, in any punctuation."""
        return bool(re.search(r"\d", when)) and _digits(self.stamp).startswith(_digits(when))

    def lines(self) -> list[str]:
        """The file's lines; empty if unreadable."""
        try:
            return self.path.read_text("utf-8", "replace").splitlines()
        except OSError:
            return []


def backups(folder: Path, bus: str, node_id: int, identity: Mapping[str, int | None]) -> list[Backup]:
    """The backups in *folder* for the node at *node_id* on *bus* with this *identity*, oldest first."""
    head, needed = f"{file_name(bus)}-{node_id}-", identity_line(identity)
    found = [Backup(path, path.name.removeprefix(head).removesuffix(".dvt")) for path in folder.glob(f"{head}*.dvt")]
    return sorted((backup for backup in found if _pins(backup.lines()) == needed), key=lambda backup: backup.stamp)


def of_this_device(found: Iterable[Backup], identity: Mapping[str, int | None]) -> list[Backup]:
    """Only the backups of the device with this serial number, or without a serial number."""
    line = serial_line(identity)
    return [backup for backup in found if line in (lines := backup.lines()) or not any(map(_tells_serial, lines))]


def _tells_serial(line: str) -> bool:
    return line.startswith("# serial number") or line == serial_line({})


def _pins(lines: Sequence[str]) -> str | None:
    """The line that pins the identity, empty if none does; None for a file without lines."""
    return next((line for line in lines[:5] if line.startswith("require ")), "") if lines else None


def remarks(path: Path) -> list[str]:
    """The remarks in the backup at *path* about settings not covered by the backup, such as multiplexed PDOs."""
    lines = path.read_text("utf-8", "replace").splitlines()
    return [line.removeprefix("# ") for line in lines if line.startswith("# ") and line.endswith(REMARKS)]


def _digits(text: str) -> str:
    return re.sub(r"\D", "", text)


def in_order(changes: Iterable[PdoChange]) -> Iterator[PdoChange]:
    """Sort *changes* to free a CAN-ID before another PDO gets the same CAN-ID, if possible."""
    pending = list(changes)
    while pending:
        free = (
            change for change in pending if not any(_holds(other, change) for other in pending if other is not change)
        )
        chosen = next(free, pending[0])
        pending.remove(chosen)
        yield chosen


def _holds(other: PdoChange, one: PdoChange) -> bool:
    """True if *other* is enabled at present with the CAN-ID wanted for *one*."""
    held, wanted = other.before.communication.cob_id, one.after.communication.cob_id
    return held.valid and wanted.valid and (held.can_id, held.extended) == (wanted.can_id, wanted.extended)


def way_to(now: Mapping[Pdo, PdoConfig], wanted: Mapping[Pdo, PdoConfig]) -> tuple[PdoChange, ...]:
    """The changes from *now* to *wanted*, without PDOs that are equal already."""
    changes = (plan_pdo(pdo, now[pdo], config) for pdo, config in wanted.items())
    return tuple(in_order([change for change in changes if change.steps]))
