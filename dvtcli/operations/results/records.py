"""A record or an array, all of it, as an answer. Knows no terminal and no session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from dvtcli.domain.abort import Abort, abort_text
from dvtcli.domain.datatypes import Value
from dvtcli.operations.results.documents import Answer, Document, Short
from dvtcli.operations.results.values import ValueRead


@dataclass(frozen=True, slots=True)
class EntryUnread(Short):
    """An entry that was not read: the device refused it with *abort*, None: nobody asked, as *why* says."""

    object: str
    name: str
    abort: int | None
    why: str = ""

    @property
    def text(self) -> str:
        """Why there is no value."""
        return self.why if self.abort is None else abort_text(self.abort)

    def document(self) -> Document:
        """Its part of a `dvtcli.value/1`."""
        abort = None if self.abort is None else f"0x{self.abort:08X}"
        return {"object": self.object, "value": None, "name": self.name, "abort": abort, "text": self.text}


@dataclass(frozen=True, slots=True)
class RecordRead(Answer):
    """A record or an array: sub-index 0 as *head*, and each entry behind it; a list of entries."""

    renderer: ClassVar = "record_lines:record_lines"

    head: ValueRead
    entries: tuple[ValueRead | EntryUnread, ...]

    @property
    def node(self) -> int:
        """The node-ID, 1…127."""
        return self.head.node

    @property
    def value(self) -> Value:
        """What sub-index 0 says: the highest sub-index."""
        return self.head.value

    @property
    def exit_code(self) -> int:
        """1 where the device refused an entry for another reason than that it can only be written."""
        refused = (entry.abort for entry in self.entries if isinstance(entry, EntryUnread))
        return int(any(abort not in (None, Abort.WRITE_ONLY) for abort in refused))

    def document(self) -> Document:
        """`dvtcli.value/1` of sub-index 0, with the *entries*."""
        entries = [{key: said for key, said in entry.document().items() if key != "schema"} for entry in self.entries]
        return {**self.head.document(), "schema": "dvtcli.value/1", "entries": entries}
