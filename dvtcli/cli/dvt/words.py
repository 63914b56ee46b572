"""The DVT's own words: whole PDOs, single SDOs, NMT state, login and store; each checked like its command."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from dvtcli.cli.command import Effect, Final, final_write
from dvtcli.cli.dvt.notation import can_id, decimal, level, meant_in_hex
from dvtcli.cli.dvt.word import MAYBE_NODE, NODE, OBJECT, VALUE, Argument, DvtWord, WordResult
from dvtcli.domain.abort import Abort
from dvtcli.domain.hint import Hint
from dvtcli.domain.nmt import NmtState
from dvtcli.errors import DeviceRefused, DvtcliError, NoAnswer, RuleError, SdoAborted, SdoProtocolError
from dvtcli.operations.results import DvtAnswer

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.results import PdoRow
    from dvtcli.operations.session.session import Session
    from dvtcli.operations.session.session_nodes import SessionNodes

#: executed by the caller
_SOURCE = DvtWord("source", (Argument("FILE", str),), "run a script", "run setup.tcl", Effect.RUNS, None)


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
    where = str(parameter.cob_id) if row.config.enabled else "off"
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
PDO_WORDS = (
    DvtWord(
        "map_in_tpdo", (*OBJECT, Argument("COB-ID", can_id, required=False)),
        "put an object into the first TPDO with room", "map tpdo1 6041 --sync 1", Effect.CHANGES, map_in,
    ),
    DvtWord("locate_tpdo", OBJECT, "which TPDO holds an object", "pdo --all", Effect.READS, locate),
    DvtWord(
        "pdo_config", (MAYBE_NODE,), "the settings of the PDOs, and how to set PDOs", "pdo", Effect.READS, config
    ),
    DvtWord(
        "clear_all_pdos", (NODE,), "no mapping, and disabled, for every PDO", "clear all", Effect.CHANGES, clear
    ),
)  # fmt: skip


def read_hex(session: SessionNodes, node_id: int, index: int, sub_index: int) -> WordResult:
    """An object as `0x…`, two digits a byte."""
    data = session.node(node_id).upload(index, sub_index)
    return WordResult(_hex(data))


def read_decimal(session: SessionNodes, node_id: int, index: int, sub_index: int) -> WordResult:
    """Read an object in decimal; signed or as text if the node's file says so."""
    from dvtcli.operations.values.object_values import value_result

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


def _final_write(name: str) -> Callable[[Sequence[Any]], Final | None]:
    return lambda values: final_write(name, values[1])


def _hex(data: bytes) -> str:
    if len(data) > _MOST_NUMBER_BYTES:
        return data.hex(" ").upper()
    return f"0x{data[::-1].hex().upper()}"


SDO_WORDS = (
    DvtWord("sdo_rnx", OBJECT, "read an object, in hex", "read 6041", Effect.READS, read_hex),
    DvtWord("sdo_rn", OBJECT, "read an object, in decimal", "read 6041", Effect.READS, read_decimal),
    DvtWord(
        "sdo_wnx", VALUE, "write an object, in hex", "write 1800:2 1", Effect.CHANGES, write, _final_write("sdo_wnx")
    ),
    DvtWord(
        "sdo_wn", VALUE, "write an object, in decimal", "write 1017 1000", Effect.CHANGES, write, _final_write("sdo_wn")
    ),
)
_STATES = {"pre": NmtState.PRE_OPERATIONAL, "op": NmtState.OPERATIONAL}


def force(session: SessionNodes, node_id: int | None, state: str | None) -> WordResult:
    """Bring a node to PRE-OPERATIONAL (with `op` OPERATIONAL) in its family's way, and confirm the state."""
    node, wanted = session.node(node_id), state or "pre"
    node.commanded()
    node.access.request(_STATES[wanted])
    if not session.dry_run:
        session.record.add(node.node_id, [f"fpo {node.node_id} {wanted}"])
    return WordResult()


def log_in_at(session: Conversation, node_id: int | None, asked: int | None) -> WordResult:
    """Log in at the level *asked*, None for the level of PDO work; finds the passcode as `login` does."""
    from dvtcli.cli.passcode import passcode
    from dvtcli.device.access_level import log_in, policy_of

    node = session.node(node_id)
    wanted = policy_of(node.access).needed if asked is None else asked
    log_in(node.access, wanted, lambda: passcode(session, node.node_id, wanted))
    if not session.dry_run:
        session.record.add(node.node_id, [f"login {wanted}"])
    return WordResult()


def store(session: SessionNodes, node_id: int | None) -> WordResult:
    """0x1010 "save", as the command `store`."""
    from dvtcli.operations.changes.store_restore import store_settings

    store_settings(session, session.node(node_id), None)
    return WordResult()


def _final_of_state(values: Sequence[Any]) -> Final | None:
    return Final("fpo op") if "op" in values else None


def _state(text: str) -> str:
    if text not in _STATES:
        raise ValueError(f"{text}: the state is pre or op")
    return text


STATE_WORDS = (
    DvtWord(
        "fpo", (MAYBE_NODE, Argument("pre|op", _state, required=False)),
        "force pre-operational (pre) or operational (op)", "nmt preop", Effect.COMMANDS, force, _final_of_state,
    ),
    DvtWord(
        "lg", (MAYBE_NODE, Argument("LEVEL", level, required=False)),
        "log in at a level, 0 to log out", "login 4", Effect.COMMANDS, log_in_at,
    ),
    DvtWord("store", (MAYBE_NODE,), "store the settings (in Tcl; elsewhere the command)", "store", Effect.KEEPS, store),
)  # fmt: skip
WORDS: dict[str, DvtWord] = {word.name: word for word in (*SDO_WORDS, *STATE_WORDS, *PDO_WORDS, _SOURCE)}
#: Longer values are no numbers: they are answered byte by byte, in wire order.
_MOST_NUMBER_BYTES = 8
_NOT_THERE = (Abort.NO_OBJECT, Abort.NO_SUB_INDEX)


def answer(word: DvtWord, session: SessionNodes, values: Sequence[Any]) -> DvtAnswer:
    """Run *word*: what our rules or the device refuse is `Abort`, silence is `Timeout`; all else is raised on."""
    given = next((value for arg, value in zip(word.arguments, values, strict=False) if arg.name == "NODE"), None)
    node, dry_run = _node(session, given), session.dry_run
    assert word.run is not None, word.name  # noqa: S101 - such a word is carried out elsewhere
    try:
        done = word.run(session, *values)
    except (SdoAborted, DeviceRefused, RuleError) as refused:
        code = Abort.GENERAL if refused.abort is None else refused.abort
        reasons = _reasons(refused)
        if code in _NOT_THERE and (meant := _meant(session, word, values)):
            reasons = (f"{reasons[0]}; {meant}", *reasons[1:])
        return DvtAnswer(word.name, node, f"Abort 0x{code:08X}", reasons, exit_code=1, dry_run=dry_run)
    except (NoAnswer, SdoProtocolError) as silent:
        return DvtAnswer(word.name, node, "Timeout", _reasons(silent), exit_code=5, dry_run=dry_run)
    return DvtAnswer(word.name, node, done.text, findings=done.findings, dry_run=dry_run, rows=done.rows)


def _node(session: SessionNodes, given: int | None) -> int | None:
    return session.selected_id() if given is None else given


def _meant(session: SessionNodes, word: DvtWord, values: Sequence[Any]) -> str:
    """Suggest an object for an absent index whose digits, read as hexadecimal, name an existing object."""
    named = {argument.name: value for argument, value in zip(word.arguments, values, strict=False)}
    if "INDEX" not in named:
        return ""
    dictionary = session.node(named["NODE"]).dictionary
    index, sub_index = named["INDEX"], named["SUB"]
    for place in dict.fromkeys(((index, meant_in_hex(sub_index)), (meant_in_hex(index), sub_index),
                              (meant_in_hex(index), meant_in_hex(sub_index)))):  # fmt: skip
        if place != (index, sub_index) and dictionary is not None and dictionary.entry(*place) is not None:
            typed = f"{index} {sub_index}"
            in_hex = f"0x{place[0]:04X} 0x{place[1]:02X}"
            return f"without 0x a number is decimal; did you mean {in_hex}? It exists; {typed} is read as decimal"
    return ""


def _reasons(error: DvtcliError) -> tuple[Hint | str, ...]:
    """Return the failure in words: what, why, and what to do."""
    return tuple(text for text in (error.text, error.why, error.hint) if text)
