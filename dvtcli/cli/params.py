"""Click types of CANopen's own words: each parses, completes and explains itself.

Knows the grammar (`domain.object_syntax`). Looks names up only in dictionaries that are known without a bus.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from dvtcli.cli.global_options import NEGATIVE_MARK
from dvtcli.domain.datatypes import BY_SHORT_NAME, parse_number
from dvtcli.domain.milliseconds import counts
from dvtcli.domain.object_syntax import (
    MappedObject,
    Skipped,
    UnknownName,
    notation_note,
    parse_cob_id,
    parse_object,
    resolve_entry,
    resolve_object,
)
from dvtcli.domain.pdo import Pdo
from dvtcli.operations.named_objects import entry_at, name_hint, object_at

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.device.node import Node

#: The word of `pdo edit tpdo1`.
EDIT = "edit"


@dataclass(frozen=True, slots=True)
class NodePdo:
    """A PDO, with the node where `5:tpdo1` names one."""

    pdo: Pdo
    node_id: int | None = None


@dataclass(frozen=True, slots=True)
class ObjectWord:
    """An object as it was typed; `resolve` finds it in the node's dictionary."""

    text: str

    @property
    def notation_note(self) -> str | None:
        """What to say of the way it was written, or None."""
        return notation_note(self.text)

    def resolve(self, node: Node) -> tuple[int, int]:
        """Index and sub-index; UsageError where the node's dictionary does not know the name."""
        return object_at(node, self.text)


@dataclass(frozen=True, slots=True)
class EntryWord:
    """A mapping entry as it was typed."""

    text: str

    @property
    def notation_note(self) -> str | None:
        """What to say of the way it was written, or None."""
        return notation_note(self.text)

    def resolve(self, node: Node) -> MappedObject | Skipped:
        """The object and its length, or the bits to skip; UsageError where the name is unknown."""
        return entry_at(node, self.text)


if TYPE_CHECKING:
    ParamType = click.ParamType[Any]
else:
    ParamType = click.ParamType  # generic only in newer click


class CanopenType(ParamType):
    """A type whose values may begin with a minus sign, and whose ValueErrors become usage errors."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse *value* once; click also hands over values that are parsed already."""
        if not isinstance(value, str):
            return value
        try:
            return self.parse(value.removeprefix(NEGATIVE_MARK), ctx)
        except ValueError as wrong:
            self.fail(str(wrong), param, ctx)

    def parse(self, text: str, ctx: click.Context | None) -> Any:
        """Turn *text* into the value; ValueError says what is wrong."""
        raise ValueError(text)


class PdoType(CanopenType):
    """`tpdo1`, `RPDO3`, `5:tpdo1`."""

    name = "pdo"

    def parse(self, text: str, ctx: click.Context | None) -> NodePdo:
        """The PDO and, with `NODE:`, its node."""
        head, colon, tail = text.rpartition(":")
        if not colon:
            return NodePdo(Pdo.parse(text))
        number = parse_number(head)
        if not 1 <= number <= 127:
            raise ValueError(f"{text!r}: node-IDs are 1…127")
        return NodePdo(Pdo.parse(tail), number)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """The node's PDOs with what each is set to, where a session is open; else the first four each way."""
        session = ctx.find_root().obj
        head, colon, wanted = incomplete.lower().rpartition(":")
        rows = _known_pdos(session, _node_id(head)) if session is not None else []
        words = rows or [(f"{way}{number}", "") for way in ("tpdo", "rpdo") for number in range(1, 5)]
        return [CompletionItem(head + colon + word, help=text) for word, text in words if word.startswith(wanted)]


def _node_id(text: str) -> int | None:
    """The node-ID before the colon of `5:tpdo1`, None where there is none yet."""
    try:
        return parse_number(text)
    except ValueError:
        return None


def _known_pdos(session: Conversation, node_id: int | None) -> list[tuple[str, str]]:
    """PDOs that the open node (None: the selected one) is known to have; never touches the bus: a key was pressed."""
    if not session.is_open:
        return []
    node = session.network.nodes.get((session.selected_id() if node_id is None else node_id) or 0)
    if node is None:
        return []
    from dvtcli.domain.pdo import transmission_type_text

    def text(pdo: Pdo) -> str:
        config = node.last_seen.get(pdo)
        if config is None:
            return ""
        kind = config.communication.transmission_type
        words = "" if kind is None else transmission_type_text(kind, pdo.direction)
        state = str(config.communication.cob_id) if config.enabled else "off"
        return f"{state}, {words}, {64 - config.bits} bits free"

    return [(str(pdo), text(pdo)) for pdo in node.present_known()]


class EditOrPdo(PdoType):
    """A PDO, or the word `edit` before it."""

    def parse(self, text: str, ctx: click.Context | None) -> Any:
        """`edit`, or the PDO."""
        return EDIT if text.lower() == EDIT else super().parse(text, ctx)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """The PDOs, and before them what can be done with one."""
        before = ctx.params.get(param.name or "") or ()
        words = [] if before or not EDIT.startswith(incomplete.lower()) else [EDIT]
        items = [CompletionItem(word, help="one PDO as text, in your editor") for word in words]
        known = any(word != EDIT for word in before)
        return [] if known else items + super().shell_complete(ctx, param, incomplete)


class ObjectType(CanopenType):
    """An object: `0x6C01:1`, `6041`, `statusword`, `"Analogue input.Channel 1"`."""

    name = "object"
    entry = False

    def parse(self, text: str, ctx: click.Context | None) -> ObjectWord | EntryWord:
        """The word; a name that no known dictionary has is refused here, before anything is sent."""
        if not self.entry:
            parse_object(text)
        session = ctx.find_root().obj if ctx is not None else None
        if session is not None and ctx is not None and not ctx.resilient_parsing:
            self._check_name(text, session)
        return EntryWord(text) if self.entry else ObjectWord(text)

    def _check_name(self, text: str, session: Conversation) -> None:
        dictionaries = session.offline_dictionaries()
        failure: ValueError | None = None
        for dictionary, aliases in dictionaries:
            try:
                (resolve_entry if self.entry else resolve_object)(text, dictionary, aliases)
            except ValueError as wrong:
                failure = failure or wrong
            else:
                return
        if isinstance(failure, UnknownName):
            raise ValueError(f"{failure}; {name_hint(failure)}")
        if failure is not None:
            raise failure

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Objects of the known dictionaries, with type, access and name."""
        from dvtcli.cli.name_completion import object_items

        return object_items(ctx, incomplete, mapped=self.entry)


class EntryType(ObjectType):
    """A mapping entry: an object, optionally `/BITS`, or `dummy/BITS`."""

    name = "entry"
    entry = True


class CobIdType(CanopenType):
    """`0x201`, `auto` or `keep`."""

    name = "cob-id"

    def parse(self, text: str, ctx: click.Context | None) -> int | str:
        """A CAN-ID, or one of the two words."""
        return text.lower() if text.lower() in ("auto", "keep") else parse_cob_id(text)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """The two words."""
        items = {"auto": "pre-defined set for PDO 1-4, else the next free one", "keep": "as it is now"}
        return [CompletionItem(word, help=text) for word, text in items.items() if word.startswith(incomplete)]


class NumberType(CanopenType):
    """A whole number, decimal or `0x…`, within *low*..*high*."""

    name = "number"

    def __init__(self, low: int, high: int, what: str = "a number") -> None:
        self.low, self.high, self.what = low, high, what

    def parse(self, text: str, ctx: click.Context | None) -> int:
        """The number; ValueError where it is outside the range."""
        value = parse_number(text)
        if not self.low <= value <= self.high:
            raise ValueError(f"{text}: {self.what} is {self.low}…{self.high}")
        return value


class TransmissionType(NumberType):
    """A transmission type 0…255; the menu offers those that are used most."""

    def __init__(self) -> None:
        super().__init__(0, 255, "a transmission type")

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """The common types with what they mean for a TPDO and for an RPDO."""
        from dvtcli.domain.pdo import Direction, transmission_type_text

        def text(kind: int) -> str:
            sent, taken = (transmission_type_text(kind, way) for way in (Direction.TPDO, Direction.RPDO))
            return sent if sent == taken else f"{sent}; RPDO: {taken}"

        kinds = [kind for kind in (1, 2, 4, 10, 0, 254, 255) if str(kind).startswith(incomplete)]
        return [CompletionItem(str(kind), help=text(kind)) for kind in kinds]


class MillisecondsType(CanopenType):
    """A time in milliseconds, kept as counts of *unit_us* µs; it must be a whole number of counts up to *most*."""

    name = "ms"

    def __init__(self, unit_us: int, most: int = 0xFFFF) -> None:
        self.unit_us, self.most = unit_us, most

    def parse(self, text: str, ctx: click.Context | None) -> int:
        """The number of counts."""
        try:
            time_ms = float(text)
        except ValueError:
            raise ValueError(f"{text!r} is not a time in milliseconds") from None
        return counts(time_ms, self.unit_us, self.most)


class TextType(CanopenType):
    """Any text, such as a value to write; only the mark of a leading minus sign is taken off."""

    name = "text"

    def parse(self, text: str, ctx: click.Context | None) -> str:
        """The text itself."""
        return text


class FileType(TextType):
    """A file's path; a shell completes it."""

    name = "file"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Whatever files there are."""
        return [CompletionItem(incomplete, type="file")]


class DataTypeParam(CanopenType):
    """A data type by its short name: `u16`, `i32`, `r32`, `vs`, `bool`, …."""

    name = "type"

    def parse(self, text: str, ctx: click.Context | None) -> Any:
        """The data type; ValueError lists the names."""
        found = BY_SHORT_NAME.get(text.lower())
        if found is None:
            raise ValueError(f"{text!r} is not a type; types are {' '.join(BY_SHORT_NAME)}")
        return found

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """The short names with CiA 301's own."""
        return [CompletionItem(k, help=t.name) for k, t in BY_SHORT_NAME.items() if k.startswith(incomplete.lower())]


PDO, OBJECT, ENTRY, COB_ID, TEXT, FILE = PdoType(), ObjectType(), EntryType(), CobIdType(), TextType(), FileType()
NODE_ID = NumberType(1, 127, "a node-ID")
