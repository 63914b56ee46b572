"""The automatic backups of one node: a script that sets all its PDOs, made before what they hold is nowhere else.

Made whole before the first change of a device; then only where a PDO holds what neither a backup nor the changes that
`undo` remembers would bring back. Does not read devices: it is handed what was read of them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from dvtcli.device.backups import backups
from dvtcli.device.change.plan_document import Identity
from dvtcli.device.change.private_file import file_name, write_private
from dvtcli.device.change_history import ChangeHistory
from dvtcli.device.trust import check_folder
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import PdoChange
from dvtcli.domain.script_line import backup_lines, backup_of, serial_line
from dvtcli.errors import InputFileError


@dataclass(slots=True)
class BackingUp:
    """The backups in *folder* of the node at *node_id* on *bus*; *past* are the changes that `undo` remembers of it."""

    folder: Path
    bus: str
    node_id: int
    past: ChangeHistory

    def needed(self, identity: Identity, held: Mapping[Pdo, PdoConfig]) -> bool:
        """Whether there is no backup of this very device, or one of the PDOs *held* is as nothing that is kept says.

        SafetyRefusal where somebody else can write there.
        """
        made = self._made(identity)
        unlike = [(pdo, config) for pdo, config in held.items() if not _is_in(made, pdo, config)]
        return not made or (bool(unlike) and not self._remembered(identity) >= set(unlike))

    def unlike_kept(self, identity: Identity, held: Mapping[Pdo, PdoConfig]) -> list[Pdo]:
        """The PDOs *held* that are as no backup of this very device and no remembered change says.

        SafetyRefusal if somebody else can write where the backups are.
        """
        made, remembered = self._made(identity), self._remembered(identity)
        return [
            pdo for pdo, config in held.items() if (pdo, config) not in remembered and not _is_in(made, pdo, config)
        ]

    def _made(self, identity: Identity) -> list[set[str]]:
        """The backups of this very device, by their lines."""
        check_folder(self.folder)
        made = [set(backup.lines()) for backup in backups(self.folder, self.bus, self.node_id, identity)]
        return [lines for lines in made if serial_line(identity) in lines]

    def _remembered(self, identity: Identity) -> set[tuple[Pdo, PdoConfig]]:
        """What PDOs held before and after the changes that `undo` remembers; nothing where their file is damaged."""
        try:
            entries = self.past.entries(self.node_id, identity)
        except InputFileError:  # the next change sets it aside, and says so
            return set()
        changes = (change for entry in entries for change in entry.plan.changes if isinstance(change, PdoChange))
        return {(change.pdo, config) for change in changes for config in (change.before, change.after)}

    def make(self, identity: Identity, pdos: Mapping[Pdo, PdoConfig], fixed: Collection[Pdo]) -> Path:
        """Keep *pdos*, which are all that the device has, and say where; the COB-IDs of *fixed* cannot be written."""
        stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%fZ")
        path = self.folder / f"{file_name(self.bus)}-{self.node_id}-{stamp}.dvt"
        write_private(path, "\n".join(backup_lines(identity, pdos, fixed)) + "\n")
        return path


def _is_in(made: Collection[set[str]], pdo: Pdo, config: PdoConfig) -> bool:
    """Whether one of the backups *made*, by their lines, would set *pdo* to *config*."""
    return any(lines.issuperset(backup_of(pdo, config)) for lines in made)
