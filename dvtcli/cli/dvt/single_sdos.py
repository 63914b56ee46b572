"""`sdo_rnx`, `sdo_rn`, `sdo_wnx`, `sdo_wn`: one SDO each. Writes follow the rules of `write`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from dvtcli.cli.dvt.notation import decimal
from dvtcli.cli.dvt.word import OBJECT, VALUE, DvtWord, WordResult
from dvtcli.cli.effect import Effect, Final, final_write

if TYPE_CHECKING:
    from dvtcli.operations.session.session import Session
    from dvtcli.operations.session.session_nodes import SessionNodes

#: Longer values are no numbers: they are answered byte by byte, in wire order.
_MOST_NUMBER_BYTES = 8


def read_hex(session: SessionNodes, node_id: int, index: int, sub_index: int) -> WordResult:
    """An object as `0x…`, two digits a byte."""
    data = session.node(node_id).upload(index, sub_index)
    return WordResult(_hex(data))


def read_decimal(session: SessionNodes, node_id: int, index: int, sub_index: int) -> WordResult:
    """Read an object in decimal; signed or as text if the node's file says so."""
    from dvtcli.operations.meanings.object_values import value_result

    node = session.node(node_id)
    return WordResult(decimal(value_result(node, index, sub_index, node.upload(index, sub_index), None).value))


def write(session: Session, node_id: int, index: int, sub_index: int, data: bytes) -> WordResult:
    """Write *data* as `write` does: checked, journalled, read back, and rolled back if different."""
    from dvtcli.device.store.store_parameters import SIGNATURES
    from dvtcli.operations.objects.write_object import signature, write_bytes

    node = session.node(node_id)
    if index in SIGNATURES:
        signature(session, node, index, sub_index, f"0x{int.from_bytes(data, 'little'):x}")
        return WordResult()
    return WordResult(findings=write_bytes(session, node, index, sub_index, data).findings)


def _final(name: str) -> Callable[[Sequence[Any]], Final | None]:
    return lambda values: final_write(name, values[1])


def _hex(data: bytes) -> str:
    if len(data) > _MOST_NUMBER_BYTES:
        return data.hex(" ").upper()
    return f"0x{data[::-1].hex().upper()}"


WORDS = (
    DvtWord("sdo_rnx", OBJECT, "read an object, in hex", "read 6041", Effect.READS, read_hex),
    DvtWord("sdo_rn", OBJECT, "read an object, in decimal", "read 6041", Effect.READS, read_decimal),
    DvtWord("sdo_wnx", VALUE, "write an object, in hex", "write 1800:2 1", Effect.CHANGES, write, _final("sdo_wnx")),
    DvtWord("sdo_wn", VALUE, "write an object, in decimal", "write 1017 1000", Effect.CHANGES, write, _final("sdo_wn")),
)
