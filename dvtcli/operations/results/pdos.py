"""A node's PDOs as answers. Knows no terminal and no session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, overload

from dvtcli.domain.datatypes import Value
from dvtcli.domain.object_scalings import NOTHING
from dvtcli.domain.pdo import ListedObjects, Pdo, PdoConfig
from dvtcli.domain.scaling import Scaling
from dvtcli.errors import UsageError
from dvtcli.operations.results.documents import Answer, Document, Rows, Short, hex_bytes, json_value, physical_document

if TYPE_CHECKING:
    from dvtcli.domain.network.received_traffic import Period


@dataclass(frozen=True, slots=True)
class PinRow(Short):
    """A pin with the tied object: index and name, None if untied."""

    pin: int
    index: int | None
    name: str = ""


@dataclass(frozen=True, slots=True)
class VpdoRow(Short):
    """A group: its object, number of pins, active pins."""

    name: str
    index: int
    pins: int
    rows: tuple[PinRow, ...]


@dataclass(frozen=True, slots=True)
class VpdoListing(Answer):
    """The virtual PDOs of a node."""

    renderer: ClassVar = "pdo_lines:vpdo_lines"

    node: int
    groups: tuple[VpdoRow, ...]
    #: the first sentence, if nothing had to change
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


@dataclass(frozen=True, slots=True)
class MappedName(Short):
    """A mapped object's name, type and scaling; empty if unknown."""

    name: str = ""
    type_name: str = ""
    meaning: Scaling = NOTHING

    @property
    def unit(self) -> str:
        """The physical unit, empty for none."""
        return self.meaning.unit


@dataclass(frozen=True, slots=True)
class LastFrame(Short):
    """The last frame received of a PDO, *age_s* seconds ago.

    *values* belong to the mapping's entries, None for gaps and values outside the frame.
    """

    data: bytes
    age_s: float
    period: Period | None
    values: tuple[Value | None, ...]

    def document(self) -> Document:
        """The element `last_frame` of `dvtcli.pdo/1`."""
        times = () if self.period is None else (self.period.last_s, self.period.least_s, self.period.most_s)
        return {
            "data": hex_bytes(self.data),
            "age_s": round(self.age_s, 3),
            "period_ms": [round(1000 * time_s, 2) for time_s in times] or None,
        }


@dataclass(frozen=True, slots=True)
class ListedRow(Short):
    """An entry of a scanner or dispatcher list, at *place*; *name* is of its first object, empty if unknown."""

    place: str
    objects: ListedObjects
    name: str = ""

    def document(self) -> Document:
        """An element of `listed` in `dvtcli.pdo/1`."""
        entry = self.objects
        source = None if entry.source is None else f"{entry.source[0]:04X}:{entry.source[1]:02X}"
        return {
            "entry": self.place, "object": f"{entry.index:04X}:{entry.sub_index:02X}", "count": max(entry.count, 1),
            "name": self.name, "source_node": entry.node_id, "source": source,
        }  # fmt: skip


@dataclass(frozen=True, slots=True)
class PdoRow(Short):
    """A PDO with names of mapped objects."""

    pdo: Pdo
    config: PdoConfig
    names: tuple[MappedName, ...] = ()
    default_can_id: int | None = None
    unstored: bool = False
    #: None if no frame was received in this session
    last: LastFrame | None = None
    #: the list of a multiplexed PDO with source addressing; None for any other PDO, and in a list of PDOs
    listed: tuple[ListedRow, ...] | None = None

    def __str__(self) -> str:
        parameter, state = self.config.communication, "enabled" if self.config.enabled else "off"
        if not self.config.has_cob_id:
            state = "?"
        mapped = " ".join(f"{entry.object}/{entry.bits}" for entry in self.config.mapping) or "nothing"
        return f"{self.pdo.label} {parameter.cob_id} {state}, type {parameter.transmission_type}: {mapped}"

    def document(self) -> Document:
        """An element of `pdos` in `dvtcli.pdo/1`."""
        parameter = self.config.communication
        told = self.config.has_cob_id
        return {
            "pdo": str(self.pdo),
            "enabled": self.config.enabled if told else None,
            "cob_id": parameter.cob_id.can_id if told else None,
            "extended": parameter.cob_id.extended if told else None,
            "rtr_allowed": parameter.cob_id.rtr_allowed if told else None,
            "transmission_type": parameter.transmission_type,
            "inhibit_ms": None if parameter.inhibit_time is None else parameter.inhibit_time / 10,
            "event_timer_ms": parameter.event_timer,
            "sync_start": parameter.sync_start_value,
            "bits": self.config.bits,
            "mapping": self._mapping(),
            "inconsistent": self.config.inconsistency or None,
            "listed": None if self.listed is None else [row.document() for row in self.listed],
            "last_frame": None if self.last is None else self.last.document() | {"values": self._last_values()},
        }

    def _last_values(self) -> list[Document]:
        """The values of the last frame by entry."""
        values = () if self.last is None else self.last.values
        names = (*self.names, *[MappedName()] * len(values))
        return [
            {"value": None if value is None else json_value(value), "physical": physical_document(value, named.meaning)}
            for value, named in zip(values, names, strict=False)
        ]

    def _mapping(self) -> list[Document]:
        rows, start = [], 0
        for number, entry in enumerate(self.config.mapping):
            named = self.names[number] if number < len(self.names) else MappedName()
            rows.append(
                {
                    "object": entry.object, "bits": entry.bits, "name": named.name, "start_bit": start,
                    "unit": named.meaning.unit, "factor": float(named.meaning.factor),
                    "offset": float(named.meaning.offset),
                }
            )  # fmt: skip
            start += entry.bits
        return rows


@dataclass(frozen=True, slots=True)
class PdoListing(Answer, Rows[PdoRow]):
    """A node's PDOs; *hidden* are left out of the text, *detail* adds the frame picture of a single row."""

    renderer: ClassVar = "pdo_lines:listing_lines"
    use_pager: ClassVar = True

    node: int
    title: str
    rows: tuple[PdoRow, ...]
    show_all: bool = False
    detail: bool = False
    sync_period_us: int | None = None
    exit_code: int = 0

    @overload
    def __getitem__(self, pdo: str | Pdo | int) -> PdoRow: ...
    @overload
    def __getitem__(self, pdo: slice) -> tuple[PdoRow, ...]: ...
    def __getitem__(self, pdo: str | Pdo | int | slice) -> PdoRow | tuple[PdoRow, ...]:
        """Return the row of a PDO (`tpdo1`), or by index; raises UsageError for other keys, KeyError if absent."""
        if isinstance(pdo, int | slice):
            return self.rows[pdo]
        try:
            wanted = pdo if isinstance(pdo, Pdo) else Pdo.parse(pdo)
        except (AttributeError, ValueError) as failed:
            raise UsageError(
                f"{pdo!r} is not a PDO: write 'tpdo1', 'rpdo3', … or the number of a row, from 0"
            ) from failed
        for row in self.rows:
            if row.pdo == wanted:
                return row
        raise KeyError(pdo)

    def document(self) -> Document:
        """`dvtcli.pdo/1`."""
        return {"schema": "dvtcli.pdo/1", "node": self.node, "pdos": [row.document() for row in self.rows]}
