"""What stands around a change on a real bus: the lock, the backup, and the journal.

Knows files in one state folder. Does not read or write devices itself; a node hands it what it needs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from dvtcli.device.journal import Identity, Journal, Journals, file_name, read_journal, write_private
from dvtcli.device.lock import NodeLock
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Plan
from dvtcli.domain.script_line import backup_lines
from dvtcli.errors import SafetyRefusal


@dataclass(slots=True)
class Keeper:
    """The files of one node on the bus called *bus*: journals and backups below *folder*, locks in *locks*.

    The locks' folder is the same for every dvtcli of a user, or they would not see each other. *say* shows a message.
    """

    folder: Path
    locks: Path
    bus: str
    node_id: int
    say: Callable[[str], None] = lambda _text: None
    #: whether a PDO's COB-ID is known to be read-only
    is_fixed: Callable[[Pdo], bool] = lambda _pdo: False
    lock: NodeLock = field(init=False)
    journals: Journals = field(init=False)
    _backed_up: bool = False

    def __post_init__(self) -> None:
        self.lock = NodeLock(self.locks, self.bus, self.node_id)
        self.journals = Journals(self.folder / "journals", self.bus)

    def open_journal(self) -> Path | None:
        """Where the journal of an unfinished change is: in our own folder, or where another dvtcli noted it."""
        own, noted = self.journals.path(self.node_id), self.lock.noted()
        return next((path for path in (own, noted) if path is not None and path.exists()), None)

    def interrupted(self) -> Journal | None:
        """The journal of a change that nobody is working on any more, or None; InputFileError where it is damaged."""
        with self._files("read"):
            path = self.open_journal()
            return read_journal(path) if path is not None and self.lock.is_free() else None

    def refuse_while_open(self) -> None:
        """Take the lock; SafetyRefusal where another dvtcli has it, or an interrupted change waits to be finished."""
        with self._files("kept"):
            self.lock.take()
            path = self.open_journal()
        if path is not None:
            raise SafetyRefusal(
                f"an interrupted change of node {self.node_id} is not finished yet",
                node=self.node_id,
                place=str(path),
                hint=f"recover puts the old configuration back, from {path}",
            )

    def begin(
        self, plan: Plan, identity: Identity, nmt_state: int | None, pdos: Callable[[], Mapping[Pdo, PdoConfig]]
    ) -> None:
        """Before the first write of *plan*: take the lock, back the PDOs up once, put the journal on disk.

        *pdos* reads the node's PDOs; it is called for the backup only.
        """
        self.refuse_while_open()
        held = {} if self._backed_up else pdos()
        with self._files("kept"):
            if not self._backed_up:
                self._back_up(identity, held)
                self._backed_up = True
            self.lock.note(self.journals.write(plan, identity, nmt_state))

    def end(self) -> None:
        """After the change was verified, or undone and verified: forget the journal."""
        with self._files("removed"):
            self.journals.remove(self.node_id)
            self.lock.note(None)

    def forget(self, journal: Journal) -> None:
        """After *journal* was recovered, wherever it was kept."""
        with self._files("removed"):
            journal.path.unlink(missing_ok=True)
        self.end()

    @contextmanager
    def _files(self, what: str) -> Iterator[None]:
        """A disk that is full or a folder that may not be written is the user's to mend, not a bug of ours."""
        try:
            yield
        except OSError as failed:
            raise SafetyRefusal(
                f"the journal of node {self.node_id} cannot be {what}: {failed.strerror or failed}",
                node=self.node_id,
                place=str(failed.filename or self.folder),
                hint="--journal DIR takes another folder; without a journal nothing is written to a real device",
            ) from failed

    def _back_up(self, identity: Identity, pdos: Mapping[Pdo, PdoConfig]) -> None:
        stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%fZ")
        path = self.folder / "backups" / f"{file_name(self.bus)}-{self.node_id}-{stamp}.dvt"
        lines = backup_lines(identity, pdos, {pdo for pdo in pdos if self.is_fixed(pdo)})
        write_private(path, "\n".join(lines) + "\n")
        self.say(f"backup of node {self.node_id}: {path}")
