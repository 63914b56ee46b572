"""The errors of a node as results."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from dvtcli.domain.emergency_codes import register_words
from dvtcli.domain.hint import Hint
from dvtcli.domain.times import utc
from dvtcli.operations.results.documents import Answer, Document, Rows, Short, hex_bytes


@dataclass(frozen=True, slots=True)
class FaultRow(Short):
    """An error by *code*, with meaning and remedy (empty if unknown).

    *source* is `active` for the family's own list, `history` for 0x1003, `heard` for EMCY messages. *information* is
    the manufacturer's field in the history; *count*, *first_s*, *last_s* (s since 1970), *register* and *manufacturer*
    are of messages.
    """

    source: str
    code: int
    text: str
    remedy: Hint | str = ""
    information: int | None = None
    count: int | None = None
    first_s: float | None = None
    last_s: float | None = None
    register: int | None = None
    manufacturer: bytes | None = None

    def document(self) -> Document:
        """The row as JSON."""
        return {
            "source": self.source,
            "code": self.code,
            "text": self.text,
            "remedy": self.remedy or None,
            "information": self.information,
            "count": self.count,
            "first": None if self.first_s is None else utc(self.first_s),
            "last": None if self.last_s is None else utc(self.last_s),
            "register": self.register,
            "manufacturer": hex_bytes(self.manufacturer),
        }


@dataclass(frozen=True, slots=True)
class Faults(Answer, Rows[FaultRow]):
    """The errors of a node, a list of rows: its own list, its history (newest first), received messages.

    *register* is 0x1001, None if absent; *has_history*: 0x1003 exists. After *cleared* the rows are the old history.
    """

    renderer: ClassVar = "fault_lines:fault_lines"
    at_leisure: ClassVar = True

    node: int
    name: str
    register: int | None
    has_history: bool
    rows: tuple[FaultRow, ...]
    cleared: bool = False
    dry_run: bool = False
    exit_code: int = 0

    @property
    def register_words(self) -> tuple[str, ...]:
        """The errors in the register."""
        return register_words(self.register or 0)

    def document(self) -> Document:
        """`dvtcli.faults/1`."""
        return {
            "schema": "dvtcli.faults/1",
            "node": self.node,
            "register": self.register,
            "register_bits": list(self.register_words),
            "has_history": self.has_history,
            "cleared": self.cleared,
            "dry_run": self.dry_run,
            "faults": [row.document() for row in self.rows],
        }


@dataclass(frozen=True, slots=True)
class FaultSeen(Answer):
    """An EMCY message received from *node*; *fault* has its meaning and count."""

    renderer: ClassVar = "fault_lines:fault_seen_lines"

    node: int
    fault: FaultRow
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.emergency/1`."""
        fault = self.fault
        return {
            "schema": "dvtcli.emergency/1",
            "time": utc(fault.last_s or 0.0),
            "node": self.node,
            "code": fault.code,
            "text": fault.text,
            "remedy": fault.remedy or None,
            "count": fault.count,
            "register": fault.register,
            "register_bits": list(register_words(fault.register or 0)),
            "manufacturer": hex_bytes(fault.manufacturer),
        }
