"""What stands around a change on a real bus: the lock, the backup, and the journal.

Knows files in one state folder. Does not read or write devices itself; a node hands it what it needs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from dvtcli.device.journal import Identity, Journal, Journals, file_name, write_private
from dvtcli.device.lock import NodeLock
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Plan
from dvtcli.domain.script_line import backup_lines
from dvtcli.errors import SafetyRefusal


@dataclass(slots=True)
class Keeper:
    """The files of one node on the bus called *bus*, below the state *folder*; *say* shows a message."""

    folder: Path
    bus: str
    node_id: int
    say: Callable[[str], None] = lambda _text: None
    #: whether a PDO's COB-ID is known to be read-only
    is_fixed: Callable[[Pdo], bool] = lambda _pdo: False
    lock: NodeLock = field(init=False)
    journals: Journals = field(init=False)
    _backed_up: bool = False

    def __post_init__(self) -> None:
        self.lock = NodeLock(self.folder / "locks", self.bus, self.node_id)
        self.journals = Journals(self.folder / "journals", self.bus)

    def interrupted(self) -> Journal | None:
        """The journal of a change that nobody is working on any more, or None."""
        return self.journals.find(self.node_id) if self.lock.is_free() else None

    def refuse_while_open(self) -> None:
        """Raise SafetyRefusal where an interrupted change of this node waits to be finished."""
        self.lock.take()
        if self.journals.path(self.node_id).exists():
            raise SafetyRefusal(
                f"an interrupted change of node {self.node_id} is not finished yet",
                node=self.node_id,
                place=str(self.journals.path(self.node_id)),
                hint="recover puts the old configuration back",
            )

    def begin(
        self, plan: Plan, identity: Identity, nmt_state: int | None, pdos: Callable[[], Mapping[Pdo, PdoConfig]]
    ) -> None:
        """Before the first write of *plan*: take the lock, back the PDOs up once, put the journal on disk.

        *pdos* reads the node's PDOs; it is called for the backup only.
        """
        self.refuse_while_open()
        if not self._backed_up:
            self._back_up(identity, pdos())
            self._backed_up = True
        self.journals.write(plan, identity, nmt_state)

    def end(self) -> None:
        """After the change was verified, or undone and verified: forget the journal."""
        self.journals.remove(self.node_id)

    def _back_up(self, identity: Identity, pdos: Mapping[Pdo, PdoConfig]) -> None:
        stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
        path = self.folder / "backups" / f"{file_name(self.bus)}-{self.node_id}-{stamp}.dvt"
        lines = backup_lines(identity, pdos, {pdo for pdo in pdos if self.is_fixed(pdo)})
        write_private(path, "\n".join(lines) + "\n")
        self.say(f"backup of node {self.node_id}: {path}")
