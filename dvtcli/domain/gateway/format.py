"""Requests as the lines of a gateway's client; `parse_request` reads each back as the same request."""

from __future__ import annotations

from dvtcli.domain.gateway.line_words import QUOTED, quoted
from dvtcli.domain.gateway.requests import Nmt, Order, PdoEntry, Read, ReadPdo, Request, SetPdo, Write, WritePdo
from dvtcli.domain.gateway.value_words import value_text
from dvtcli.domain.nmt import NmtCommand

_NMT = {
    NmtCommand.START: "start",
    NmtCommand.STOP: "stop",
    NmtCommand.ENTER_PRE_OPERATIONAL: "preop",
    NmtCommand.RESET_NODE: "reset node",
    NmtCommand.RESET_COMMUNICATION: "reset comm",
}


def format_request(request: Request) -> str:
    """The line of *request*, without its end."""
    head = [] if request.sequence is None else [f"[{request.sequence}]"]
    where = [str(number) for number in (request.net, request.node) if number is not None]
    return " ".join([*head, *where, _command(request)])


def _command(request: Request) -> str:
    match request.command:
        case Read(index, sub_index, None):
            return f"r 0x{index:04X} {sub_index}"
        case Read(index, sub_index, data_type):
            return f"r 0x{index:04X} {sub_index} {data_type}"
        case Write(index, sub_index, data_type, data):
            return f"w 0x{index:04X} {sub_index} {data_type} {value_text(data_type, data, wide_as_hex=True)}"
        case Nmt(command):
            return _NMT[command]
        case Order(name, numbers):
            return " ".join([name, *map(str, numbers)])
        case ReadPdo(number):
            return f"r p {number}"
        case WritePdo(number, values):
            return " ".join([f"w p {number} {len(values)}", *map(_word, values)])
        case SetPdo() as pdo:
            kind = "tpdo" if pdo.is_tpdo else "rpdo"
            head = f"set {kind} {pdo.number} 0x{pdo.cob_id:X} {pdo.transmission} {len(pdo.entries)}"
            return " ".join([head, *map(_entry, pdo.entries)])


def _word(word: str) -> str:
    return quoted(word.removeprefix(QUOTED)) if word.startswith(QUOTED) else word


def _entry(entry: PdoEntry) -> str:
    return entry.data_type if entry.index is None else f"0x{entry.index:04X} {entry.sub_index} {entry.data_type}"
