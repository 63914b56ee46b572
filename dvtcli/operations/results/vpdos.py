"""Virtual PDOs as an answer. Knows no terminal and no session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from dvtcli.operations.results.documents import Answer, Document, Short


@dataclass(frozen=True, slots=True)
class PinRow(Short):
    """One pin with the object it is tied to: its index and name, None where it is tied to nothing."""

    pin: int
    index: int | None
    name: str = ""


@dataclass(frozen=True, slots=True)
class VpdoRow(Short):
    """One group: its object, how many pins the device has, and the active ones."""

    name: str
    index: int
    pins: int
    rows: tuple[PinRow, ...]


@dataclass(frozen=True, slots=True)
class VpdoListing(Answer):
    """The virtual PDOs of a node."""

    renderer: ClassVar = "vpdo_lines:vpdo_lines"

    node: int
    groups: tuple[VpdoRow, ...]
    #: the first sentence, where something was asked for that is so already
    said: str = ""
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.vpdo/1`."""
        return {
            "schema": "dvtcli.vpdo/1",
            "node": self.node,
            "groups": [
                {
                    "group": group.name,
                    "object": f"{group.index:04X}:00",
                    "active": len(group.rows),
                    "pins": group.pins,
                    "tied": [
                        {
                            "pin": row.pin,
                            "object": None if row.index is None else f"{row.index:04X}:00",
                            "name": row.name,
                        }
                        for row in group.rows
                    ],
                }
                for group in self.groups
            ],
        }
