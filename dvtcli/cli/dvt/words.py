"""The DVT's own words, with their arguments and numbers, as click commands; each is checked like its command."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.command import DvtCommand, Effect, Final, final_write
from dvtcli.cli.params import FILE, TEXT, CanopenType, TextType
from dvtcli.cli.runner_interface import runners
from dvtcli.domain.abort import Abort
from dvtcli.domain.datatypes import Value, parse_number
from dvtcli.domain.hint import Hint
from dvtcli.domain.nmt import NmtState
from dvtcli.errors import DeviceRefused, DvtcliError, NoAnswer, RuleError, SdoAborted, SdoProtocolError
from dvtcli.operations.results import DvtAnswer

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from dvtcli.cli.conversation import Conversation
    from dvtcli.domain.rules.finding import Finding
    from dvtcli.operations.results import PdoRow
    from dvtcli.operations.session.session import Session, SessionNodes


@dataclass(frozen=True, slots=True)
class Argument:
    """An argument of a word: its name, and the reader of its text (raises ValueError with the reason)."""

    name: str
    read: Callable[[str], Any]
    required: bool = True

    @property
    def shown(self) -> str:
        """The argument in a grammar."""
        return self.name if self.required else f"[{self.name}]"


@dataclass(frozen=True, slots=True)
class DvtWord:
    """A word; *modern* is the equivalent command line.

    *effect* is the effect on nodes. *run* executes the word with the session and the values of `bind`, and raises its
    functions' errors; None if the caller executes it. *final* returns the part that no undo reverts, if dependent on
    values.
    """

    name: str
    arguments: tuple[Argument, ...]
    summary: str
    modern: str
    effect: Effect
    run: Callable[..., WordResult] | None
    final: Callable[[Sequence[Any]], Final | None] | None = None

    @property
    def grammar(self) -> str:
        """The word with its arguments."""
        return " ".join([self.name, *(argument.shown for argument in self.arguments)])

    def bind(self, texts: Sequence[str]) -> list[Any]:
        """Return the arguments' values, None if omitted. Raises ValueError with the reason."""
        least = sum(argument.required for argument in self.arguments)
        if not least <= len(texts) <= len(self.arguments):
            raise ValueError(f"it is: {self.grammar}")
        given: Sequence[str | None] = texts
        if texts and len(texts) < len(self.arguments) and not (self.arguments[0].required or texts[0][:1].isdigit()):
            given = (None, *texts)  # `fpo pre`: the node is left out
        pairs = zip(self.arguments, given, strict=False)
        values: list[Any] = [None if text is None else argument.read(text) for argument, text in pairs]
        values += [None] * (len(self.arguments) - len(values))
        names = [argument.name for argument in self.arguments]
        if "VALUE" in names:  # its bytes depend on the width behind it
            size = values.pop()
            values[-1] = value_bytes(values[-1], size)
        return values


#: executed by the caller
_SOURCE = DvtWord("source", (Argument("FILE", str),), "run a script", "run setup.tcl", Effect.RUNS, None)


def map_in(session: SessionNodes, node_id: int, index: int, sub_index: int, given: int | None) -> WordResult:
    """Map an object into the first TPDO with room, or into the TPDO with CAN-ID *given*; see `first_tpdo`."""
    from dvtcli.operations.pdos.edit_pdos import map_in_tpdo

    return WordResult(findings=map_in_tpdo(session, node_id, index, sub_index, given))


def locate(session: SessionNodes, node_id: int, index: int, sub_index: int) -> WordResult:
    """Return `TPDO1 0x181 bit 0` for the first TPDO that maps the object, enabled first; else `not mapped`."""
    from dvtcli.operations.pdos.edit_pdos import locate_tpdo

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
    from dvtcli.operations.pdos.edit_pdos import clear_all

    return WordResult(findings=clear_all(session, node_id).findings)


#: dvtcli's equivalents of the DVT script of this name.
_HOW = (
    "set one: map_in_tpdo, clear_all_pdos, sdo_wnx (help dvt), or: map tpdo1 6041 --sync 1",
    "set all: a script with such lines; run FILE.dvt or FILE.tcl",
)


def node_id(text: str) -> int:
    """A node-ID, 1…127; ValueError otherwise."""
    return _within(text, 1, 127, "a node-ID")


def _within(text: str, low: int, high: int, what: str) -> int:
    found = parse_number(text)
    if not low <= found <= high:
        raise ValueError(f"{text}: {what} is {low}…{high}")
    return found


NODE = Argument("NODE", node_id)
MAYBE_NODE = Argument("NODE", node_id, required=False)
#: Below this index CiA 301 has data types: an index without `0x` most likely lacks the `0x`.
_FIRST_OBJECT = 0x1000


def index(text: str) -> int:
    """Return an object's index. Raises ValueError if malformed, or hexadecimal without `0x`."""
    digits = text.strip().lower()
    looks_hex = len(digits) == 4 and all(digit in "0123456789abcdef" for digit in digits)
    if looks_hex and (not digits.isdigit() or int(digits) < _FIRST_OBJECT):
        raise ValueError(f"{text}: a number without 0x is decimal here; for index 0x{digits.upper()} write the 0x")
    return _within(text, 1, 0xFFFF, "an index")


def sub_index(text: str) -> int:
    """A sub-index, 0…255; ValueError otherwise."""
    return _within(text, 0, 0xFF, "a sub-index")


OBJECT = (NODE, Argument("INDEX", index), Argument("SUB", sub_index))


@dataclass(frozen=True, slots=True)
class WordResult:
    """The result of a word: its text, and findings of rules."""

    text: str = "OK"
    findings: tuple[Finding, ...] = ()
    #: the lines of a text with several
    rows: tuple[str, ...] = ()


def can_id(text: str) -> int:
    """Return a CAN-ID of 11 bits. Raises ValueError otherwise."""
    return _within(text, 1, 0x7FF, "a CAN-ID")


PDO_WORDS = (
    DvtWord(
        "map_in_tpdo", (*OBJECT, Argument("COB-ID", can_id, required=False)),
        "put an object into the first TPDO with room", "map tpdo1 6041 --sync 1", Effect.CHANGES, map_in,
    ),
    DvtWord("locate_tpdo", OBJECT, "which TPDO holds an object", "pdo --all", Effect.NONE, locate),
    DvtWord(
        "pdo_config", (MAYBE_NODE,), "the settings of the PDOs, and how to set PDOs", "pdo", Effect.NONE, config
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


#: Widths of values in bytes.
WIDTHS = (1, 2, 3, 4, 8)


def width(text: str) -> int:
    """Return a value's width in bytes. Raises ValueError for an impossible width."""
    found = parse_number(text)
    if found not in WIDTHS:
        raise ValueError(f"{text}: a value has {', '.join(map(str, WIDTHS))} bytes")
    return found


VALUE = (*OBJECT, Argument("VALUE", str), Argument("BYTES", width, required=False))


def decimal(value: Value) -> str:
    """Return a read value for Tcl: numbers in decimal, text unchanged, bytes in wire order."""
    if isinstance(value, bytes):
        return value.hex(" ").upper()
    return str(int(value) if isinstance(value, bool) else value)


SDO_WORDS = (
    DvtWord("sdo_rnx", OBJECT, "read an object, in hex", "read 6041", Effect.NONE, read_hex),
    DvtWord("sdo_rn", OBJECT, "read an object, in decimal", "read 6041", Effect.NONE, read_decimal),
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


def level(text: str) -> int:
    """An access level, 0 to log out; ValueError otherwise."""
    return _within(text, 0, 0xFF, "an access level")


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


#: special characters in a Tcl list
_SPECIAL = re.compile(r'[\s{}\[\]$";\\#]')
_ESCAPES = {"\n": r"\n", "\r": r"\r", "\t": r"\t", "\v": r"\v", "\f": r"\f"}


def value_bytes(text: str, wanted: int | None) -> bytes:
    """Return *text* as bytes of an SDO download, lowest first; *wanted* is the width (None: from the digits).

    Raises ValueError if the width is unknown, or the number does not fit.
    """
    number = parse_number(text)
    size = wanted if wanted is not None else _width_of_digits(text)
    low = -(1 << 8 * size - 1)
    if not low <= number < 1 << 8 * size:
        raise ValueError(f"{text} does not fit into {size} byte{'' if size == 1 else 's'}")
    return (number % (1 << 8 * size)).to_bytes(size, "little")


def listed(values: Iterable[Value]) -> str:
    """Return values as a Tcl list; a device's text can neither end an element nor be a command."""
    return " ".join(
        _SPECIAL.sub(lambda found: _ESCAPES.get(found[0], f"\\{found[0]}"), decimal(value)) or "{}" for value in values
    )


def meant_in_hex(number: int) -> int:
    """Return the intended number if *number* was typed with hexadecimal digits without `0x`."""
    return int(str(number), 16)


def _width_of_digits(text: str) -> int:
    digits = text.strip().lower()
    if not digits.startswith("0x"):
        raise ValueError(
            f"{text}: a decimal value needs its width in bytes after it, or write it in hex: 0x00 is 1 byte"
        )
    count = len(digits) - 2
    if count % 2 or count // 2 not in WIDTHS:
        raise ValueError(f"{text}: in hex the digits set the width, 2 per byte; {count} digits are not possible")
    return count // 2


class NodeText(TextType):
    """A typed node-ID, with completion of known nodes."""

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Offer the session's node-IDs without using a bus."""
        from click.shell_completion import CompletionItem as Item

        del param
        session: Conversation | None = ctx.find_root().obj
        known = session.known_ids() if session is not None else []
        return [Item(str(node_id)) for node_id in known if str(node_id).startswith(incomplete)]


class WordCommand(DvtCommand):
    """A word; its arguments are read together, since a value's width may follow it."""

    def __init__(self, word: DvtWord) -> None:
        self.word = word
        kinds: dict[str, CanopenType] = {"NODE": NodeText(), "FILE": FILE}
        params: list[click.Parameter] = [
            click.Argument(
                [f"dvt_{number}"], type=kinds.get(one.name, TEXT), required=one.required, metavar=one.shown
            )
            for number, one in enumerate(word.arguments)
        ]  # fmt: skip
        text = f"{word.summary[0].upper()}{word.summary[1:]}. The modern form: {word.modern}. More: help dvt."
        final = word.final
        super().__init__(
            word.name, params=params, callback=click.pass_context(self._run), help=text, effect=word.effect,
            final=None if final is None else lambda params: final(params["values"]),
        )  # fmt: skip

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse *args* and read them by the word's own rules."""
        rest = super().parse_args(ctx, args)
        texts = [ctx.params.pop(key) for key in sorted(key for key in ctx.params if key.startswith("dvt_"))]
        if ctx.resilient_parsing:
            return rest
        try:
            ctx.params["values"] = self.word.bind([text for text in texts if text is not None])
        except ValueError as wrong:
            raise click.UsageError(f"{self.word.name}: {wrong}", ctx) from wrong
        return rest

    def _run(self, ctx: click.Context, /, values: list[Any]) -> Any:
        if self.word.run is None:
            return runners(ctx).file(ctx.obj, values[0])
        return answer(self.word, ctx.obj, values)


def word_command(name: str) -> WordCommand | None:
    """The word *name* as a click command, or None."""
    word = WORDS.get(name)
    return None if word is None else WordCommand(word)
