"""`map_in_tpdo`, `locate_tpdo`, `clear_all_pdos`, `pdo_config`: the DVT's ways with whole PDOs, checked."""

from __future__ import annotations

from itertools import zip_longest
from typing import TYPE_CHECKING

from dvtcli.cli.dvt.notation import can_id
from dvtcli.cli.dvt.word import MAYBE_NODE, NODE, OBJECT, Argument, DvtWord, WordResult
from dvtcli.cli.effect import Effect

if TYPE_CHECKING:
    from dvtcli.operations.results import PdoRow
    from dvtcli.operations.session.session_nodes import SessionNodes


def map_in(session: SessionNodes, node_id: int, index: int, sub_index: int, given: int | None) -> WordResult:
    """Map an object into the first TPDO with room, or into the TPDO with CAN-ID *given*; see `first_tpdo`."""
    from dvtcli.operations.pdos.first_tpdo import map_in_tpdo

    return WordResult(findings=map_in_tpdo(session, node_id, index, sub_index, given))


def locate(session: SessionNodes, node_id: int, index: int, sub_index: int) -> WordResult:
    """Return `TPDO1 0x181 bit 0` for the first TPDO that maps the object, enabled first; else `not mapped`."""
    from dvtcli.operations.pdos.first_tpdo import locate_tpdo

    return WordResult(locate_tpdo(session, node_id, index, sub_index))


def config(session: SessionNodes, node_id: int | None) -> WordResult:
    """List the settings of every non-empty PDO of a node, a line each, and the words to set PDOs."""
    from dvtcli.operations.pdos.list_pdos import list_pdos

    listing = list_pdos(session, node_id)
    lines = [_one(row) for row in listing.rows if row.config.mapping or row.config.enabled]
    return WordResult("\n".join(rows := (*lines, *_HOW)), rows=rows)


def _one(row: PdoRow) -> str:
    """`TPDO1 0x181 type 255: 0x6041:00/16 Statusword`."""
    parameter = row.config.communication
    where = f"0x{parameter.cob_id.can_id:03X}" if row.config.enabled else "off"
    pairs = zip_longest(row.config.mapping, row.names)
    mapped = [f"0x{entry.object}/{entry.bits} {name.name if name else ''}".rstrip() for entry, name in pairs if entry]
    return f"{row.pdo.label} {where} type {parameter.transmission_type}: {', '.join(mapped) or 'nothing'}"


def clear(session: SessionNodes, node_id: int) -> WordResult:
    """Empty and disable every PDO with a writable mapping."""
    from dvtcli.operations.pdos.switch import clear_all

    return WordResult(findings=clear_all(session, node_id).findings)


#: dvtcli's equivalents of the DVT script of this name.
_HOW = (
    "set one: map_in_tpdo, clear_all_pdos, sdo_wnx (help dvt), or: map tpdo1 6041 --sync 1",
    "set all: a script with such lines; run FILE.dvt or FILE.tcl",
)

WORDS = (
    DvtWord(
        "map_in_tpdo", (*OBJECT, Argument("COB-ID", can_id, required=False)),
        "put an object into the first TPDO with room", "map tpdo1 6041 --sync 1", Effect.CHANGES, map_in,
    ),
    DvtWord("locate_tpdo", OBJECT, "which TPDO holds an object", "pdo --all", Effect.READS, locate),
    DvtWord(
        "pdo_config", (MAYBE_NODE,), "what the PDOs are set to, and how they are set", "pdo", Effect.READS, config
    ),
    DvtWord(
        "clear_all_pdos", (NODE,), "no mapping, and disabled, for every PDO", "clear all", Effect.CHANGES, clear
    ),
)  # fmt: skip
