"""Values and dictionary entries as answers. Knows no terminal and no session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from dvtcli.domain.datatypes import Value
from dvtcli.domain.meanings import NOTHING
from dvtcli.domain.scaling import Scaling
from dvtcli.operations.results.documents import Answer, Document, Rows, Short, hex_bytes, json_value, physical_document


@dataclass(frozen=True, slots=True)
class ValueRead(Answer):
    """One object's value, raw and decoded, and its physical *meaning*; *written* where a write set it."""

    renderer: ClassVar = "value_lines:value_lines"

    node: int
    object: str
    name: str
    value: Value
    raw: bytes
    type_name: str
    meaning: Scaling = NOTHING
    written: bool = False
    exit_code: int = 0

    @property
    def unit(self) -> str:
        """The physical unit, empty where it has none."""
        return self.meaning.unit

    @property
    def physical(self) -> float | None:
        """The number in that unit, None where the value is none."""
        number = isinstance(self.value, int | float) and self.meaning.has_number
        return self.meaning.number(self.value) if number and isinstance(self.value, int | float) else None

    @property
    def text(self) -> str:
        """The value as screens show it: `48.0 V (768)`; empty where nobody says what it means."""
        return self.meaning.text(self.value, 8 * len(self.raw))

    def document(self) -> Document:
        """`dvtcli.value/1`."""
        return {
            "schema": "dvtcli.value/1",
            "node": self.node,
            "object": self.object,
            "value": json_value(self.value),
            "raw": hex_bytes(self.raw),
            "type": self.type_name,
            "name": self.name,
            "physical": physical_document(self.value, self.meaning),
        }


@dataclass(frozen=True, slots=True)
class ObjectRow(Short):
    """One dictionary entry as `objects` shows it."""

    object: str
    name: str
    type_name: str
    access: str
    mappable: str
    default: str


@dataclass(frozen=True, slots=True)
class ObjectListing(Answer, Rows[ObjectRow]):
    """Entries of the object dictionary, a list of rows; *total* is how many the file has."""

    renderer: ClassVar = "value_lines:object_lines"
    at_leisure: ClassVar = True

    node: int | None
    source: str
    rows: tuple[ObjectRow, ...]
    total: int
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.objects/1`."""
        rows = [
            {
                "object": row.object,
                "name": row.name,
                "type": row.type_name,
                "access": row.access,
                "mappable": row.mappable.split(),
            }
            for row in self.rows
        ]
        return {"schema": "dvtcli.objects/1", "node": self.node, "source": self.source, "objects": rows}
