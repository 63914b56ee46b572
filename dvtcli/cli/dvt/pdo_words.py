"""`map_in_tpdo`, `locate_tpdo`, `clear_all_pdos`: the DVT's ways with whole PDOs, by the safe sequence."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.cli.dvt.done import Done
from dvtcli.cli.dvt.notation import can_id
from dvtcli.cli.dvt.word import NODE, OBJECT, Argument, Word
from dvtcli.cli.effect import Effect

if TYPE_CHECKING:
    from dvtcli.operations.session import Session


def map_in(session: Session, node_id: int, index: int, sub_index: int, given: int | None) -> Done:
    """Put an object into the first TPDO with room, or into one whose CAN-ID is *given*; see `first_tpdo`."""
    from dvtcli.operations.first_tpdo import map_in_tpdo

    return Done(findings=map_in_tpdo(session, node_id, index, sub_index, given))


def locate(session: Session, node_id: int, index: int, sub_index: int) -> Done:
    """`TPDO1 0x181 bit 0` for the first TPDO that maps the object, enabled ones first; else `not mapped`."""
    from dvtcli.operations.first_tpdo import locate_tpdo

    return Done(locate_tpdo(session, node_id, index, sub_index))


def clear(session: Session, node_id: int) -> Done:
    """Empty and disable every PDO whose mapping can be changed."""
    from dvtcli.operations.switch import clear_all

    return Done(findings=clear_all(session, node_id).findings)


WORDS = (
    Word(
        "map_in_tpdo", (*OBJECT, Argument("COB-ID", can_id, required=False)),
        "put an object into the first TPDO with room", "map tpdo1 6041 --sync 1", Effect.CHANGES, map_in,
    ),
    Word("locate_tpdo", OBJECT, "which TPDO holds an object", "pdo --all", Effect.READS, locate),
    Word(
        "clear_all_pdos", (NODE,), "no mapping, and disabled, for every PDO", "clear all", Effect.CHANGES, clear
    ),
)  # fmt: skip
