"""List a node's PDOs with names of mapped objects. Only reads."""

from __future__ import annotations

from dataclasses import replace
from time import monotonic
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import read_mpdo_lists, read_optional
from dvtcli.domain.frame import byte_length, decode
from dvtcli.domain.objects import CYCLE_PERIOD
from dvtcli.domain.pdo import DISPATCHER_LISTS, SAM_MPDO, SCANNER_LISTS
from dvtcli.operations.results import LastFrame, ListedRow, MappedName, PdoListing, PdoRow
from dvtcli.operations.values.object_values import scalings_of

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.datatypes import DataType
    from dvtcli.domain.object_scalings import ObjectScalings
    from dvtcli.domain.pdo import Pdo, PdoConfig, PdoMappingEntry
    from dvtcli.operations.session.session import Session, SessionNodes


def list_pdos(session: SessionNodes, node_id: int | None = None, *, show_all: bool = False) -> PdoListing:
    """Read every PDO of *node_id*, None for the selected node; *show_all* includes disabled and empty PDOs."""
    node = session.node(node_id)
    rows = tuple(_row(node, pdo, config) for pdo, config in node.pdos().items())
    return PdoListing(node.node_id, node.title, rows, show_all)


def show_pdo(session: Session, pdo: Pdo, node_id: int | None = None) -> PdoListing:
    """Read a PDO of *node_id*, None for the selected node, with its last received frame."""
    node = session.node(node_id)
    row = _row(node, pdo, node.pdo(pdo))
    row = replace(row, last=last_frame(session, node, pdo, row.config), listed=_listed(node, pdo, row.config))
    period = read_optional(node.sdo, CYCLE_PERIOD, 0, 4)
    return PdoListing(node.node_id, node.title, (row,), detail=True, sync_period_us=period)


def _listed(node: ReadableNode, pdo: Pdo, config: PdoConfig) -> tuple[ListedRow, ...] | None:
    """Read the scanner or dispatcher list of a multiplexed PDO with source addressing; None for any other PDO."""
    if config.mpdo != SAM_MPDO:
        return None
    lists = SCANNER_LISTS if pdo.is_tpdo else DISPATCHER_LISTS
    scalings = scalings_of(node.profile, node.dictionary)
    return tuple(
        ListedRow(f"{index:04X}:{sub_index:02X}", entry, _name(node, scalings, entry.index, entry.sub_index).name)
        for (index, sub_index), entry in read_mpdo_lists(node.sdo, node.dictionary, lists).items()
    )


def _row(node: Node, pdo: Pdo, config: PdoConfig) -> PdoRow:
    scalings = scalings_of(node.profile, node.dictionary)
    named = tuple(_name(node, scalings, entry.index, entry.sub_index) for entry in config.mapping)
    return PdoRow(pdo, config, named, pdo.default_can_id(node.node_id), pdo.label in node.unstored)


def _name(node: NodeDescription, scalings: ObjectScalings, index: int, sub_index: int) -> MappedName:
    meaning = scalings.of(index, sub_index)
    entry = node.dictionary.entry(index, sub_index) if node.dictionary else None
    if entry is None or node.dictionary is None:
        return MappedName(meaning=meaning)
    kind = entry.data_type.short if entry.data_type else ""
    return MappedName(node.dictionary.display_name(index, sub_index), kind, meaning)


def last_frame(session: Session, node: NodeDescription, pdo: Pdo, config: PdoConfig) -> LastFrame | None:
    """Return the last frame with the PDO's COB-ID received since the PDO was set, if any.

    It has no values if a TPDO's frame has another length than the mapping, or an RPDO's frame is shorter. A twin's
    frames are not received.
    """
    cob_id, frames = config.communication.cob_id, session.frames
    if frames is None or session.dry_run or not config.enabled or config.mpdo is not None:
        return None
    received = frames.last(cob_id.can_id, extended=cob_id.extended)
    if received is None or received.at_s <= frames.set_s(node.node_id, (pdo.communication_index, pdo.mapping_index)):
        return None
    mapped = byte_length(config.bits)
    if len(received.data) < mapped or (pdo.is_tpdo and len(received.data) != mapped):
        return LastFrame(received.data, monotonic() - received.at_s, received.period, (None,) * len(config.mapping))

    def type_of(mapped: PdoMappingEntry) -> DataType | None:
        entry = node.dictionary.entry(mapped.index, mapped.sub_index) if node.dictionary else None
        return None if entry is None else entry.data_type

    found = iter(decode(config.mapping, received.data, type_of))
    values = tuple(None if entry.is_dummy else next(found).value for entry in config.mapping)
    return LastFrame(received.data, monotonic() - received.at_s, received.period, values)
