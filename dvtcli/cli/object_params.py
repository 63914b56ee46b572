"""Click types of objects, PDOs and their parameters; completion uses PDOs already read, no bus."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from dvtcli.cli.params import CanopenType, Listed, NumberType
from dvtcli.domain.datatypes import BY_SHORT_NAME, parse_number
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
from dvtcli.errors import UsageError
from dvtcli.operations.values.named_objects import entry_at, is_name, name_hint, object_at, one_name

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.device.node_parts import NodeDescription
    from dvtcli.operations.session.session_nodes import SessionNodes


@dataclass(frozen=True, slots=True)
class ObjectWord:
    """An object as typed; `resolve` finds the object in the node's dictionary."""

    text: str
    #: the node in `3:6041`, None if absent
    node_id: int | None = None

    @property
    def notation_note(self) -> str | None:
        """A remark on the notation, or None."""
        return notation_note(self.text)

    def resolve(self, node: NodeDescription) -> tuple[int, int]:
        """Return index and sub-index. Raises UsageError if the node's dictionary lacks the name."""
        return object_at(node, self.text)


@dataclass(frozen=True, slots=True)
class EntryWord:
    """A mapping entry as typed."""

    text: str

    @property
    def notation_note(self) -> str | None:
        """A remark on the notation, or None."""
        return notation_note(self.text)

    def resolve(self, node: NodeDescription) -> MappedObject | Skipped:
        """Return the object and its length, or the bits to skip. Raises UsageError for an unknown name."""
        return entry_at(node, self.text)


class ObjectParam(CanopenType):
    """An object: `0x6C01:1`, `6041`, `statusword`, `"Analogue input.Channel 1"`."""

    name = "object"
    entry = False

    def parse(self, text: str, ctx: click.Context | None) -> ObjectWord | EntryWord:
        """The word; UsageError for a name that no known dictionary has, before anything is sent."""
        if not self.entry:
            parse_object(text)
        session = ctx.find_root().obj if ctx is not None else None
        if session is not None and ctx is not None and not ctx.resilient_parsing:
            self._check_name(text, session)
        return EntryWord(text) if self.entry else ObjectWord(text)

    def _check_name(self, text: str, session: Conversation) -> None:
        resolve = resolve_entry if self.entry else resolve_object
        with suppress(ValueError):
            resolve(text, None)  # a number needs no dictionary: none is read for it
            return
        failure: ValueError | None = None
        for dictionary, profile in session.offline_dictionaries():
            try:
                resolve(text, dictionary, profile.aliases)
            except ValueError as wrong:
                failure = failure or wrong
            else:
                return
        if isinstance(failure, UnknownName):
            raise UsageError(str(failure), hint=name_hint(failure)) from failure
        if failure is not None:
            raise failure

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Offer objects of known dictionaries, with type, access and name."""
        from dvtcli.cli.name_completion import object_items

        return object_items(ctx, incomplete, mapped=self.entry)


class NodeObjectType(ObjectParam):
    """An object, optionally with its node: `3:6041`, `3:1018:01`, `3:statusword`."""

    def parse(self, text: str, ctx: click.Context | None) -> ObjectWord | EntryWord:
        """The word; ValueError as for an object, and for a node-ID that is none."""
        head, colon, tail = text.partition(":")
        if not colon or not head.isdecimal() or len(head) > 3:
            return super().parse(text, ctx)
        if not 1 <= int(head) <= 127:
            raise ValueError(f"{text!r}: node-IDs are 1…127")
        return ObjectWord(super().parse(tail, ctx).text, int(head))


class Objects(Listed):
    """Several objects; a name with blanks typed without quotes is refused with the right notation."""

    def type_cast_value(self, ctx: click.Context, value: Any) -> Any:
        """Return the words. Raises BadParameter if a word is no object, UsageError if no dictionary has its name."""
        try:
            return super().type_cast_value(ctx, value)
        except (click.BadParameter, UsageError) as wrong:
            said = one_name(value or (), lambda name: self._is_value(ctx, name))
            if said is None:
                raise
            raise click.BadParameter(said, ctx, self) from wrong

    def _is_value(self, ctx: click.Context, text: str) -> bool:
        """Whether *text* is an object; numbers with commas between them are no name, known or not."""
        first, comma, _ = text.partition(",")
        return not (comma and not is_name(first)) and super()._is_value(ctx, text)


class EntryType(ObjectParam):
    """A mapping entry: an object, optionally `/BITS`, or `dummy/BITS`."""

    name = "entry"
    entry = True


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


OBJECT, ENTRY = NodeObjectType(), EntryType()
#: The word of `pdo edit tpdo1`.
EDIT = "edit"


@dataclass(frozen=True, slots=True)
class NodePdo:
    """A PDO, with the node of `5:tpdo1` if named."""

    pdo: Pdo
    node_id: int | None = None


class PdoType(CanopenType):
    """`tpdo1`, `RPDO3`, `5:tpdo1`."""

    name = "pdo"

    def parse(self, text: str, ctx: click.Context | None) -> NodePdo:
        """Return the PDO and, with `NODE:`, its node."""
        head, colon, tail = text.rpartition(":")
        if not colon:
            return NodePdo(Pdo.parse(text))
        number = parse_number(head)
        if not 1 <= number <= 127:
            raise ValueError(f"{text!r}: node-IDs are 1…127")
        return NodePdo(Pdo.parse(tail), number)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Offer the node's PDOs with their settings in a session; else the first four each way."""
        session = ctx.find_root().obj
        head, colon, wanted = incomplete.lower().rpartition(":")
        rows = _known_pdos(session, _node_id(head)) if session is not None else []
        words = rows or [(f"{way}{number}", "") for way in ("tpdo", "rpdo") for number in range(1, 5)]
        return [CompletionItem(head + colon + word, help=text) for word, text in words if word.startswith(wanted)]


def _node_id(text: str) -> int | None:
    """Return the node-ID before the colon of `5:tpdo1`, None if absent."""
    try:
        return parse_number(text)
    except ValueError:
        return None


def _known_pdos(session: SessionNodes, node_id: int | None) -> list[tuple[str, str]]:
    """Return known PDOs of the open node (None: the selected node) without using the bus on a key press."""
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


class PdoOrFile(PdoType):
    """A PDO, or the name of a file that has a suffix."""

    name = "pdo or file"

    def parse(self, text: str, ctx: click.Context | None) -> Any:
        """Return the PDO, or the name of the file."""
        return text if Path(text).suffix else super().parse(text, ctx)


class EditOrPdo(PdoType):
    """A PDO, or the word `edit` before a PDO."""

    def parse(self, text: str, ctx: click.Context | None) -> Any:
        """`edit`, or the PDO."""
        return EDIT if text.lower() == EDIT else super().parse(text, ctx)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Offer actions, then PDOs."""
        before = ctx.params.get(param.name or "") or ()
        words = [] if before or not EDIT.startswith(incomplete.lower()) else [EDIT]
        items = [CompletionItem(word, help="one PDO as text, in your editor") for word in words]
        known = any(word != EDIT for word in before)
        return [] if known else items + super().shell_complete(ctx, param, incomplete)


class CobIdType(CanopenType):
    """`0x201`, `auto` or `keep`."""

    name = "cob-id"

    def parse(self, text: str, ctx: click.Context | None) -> int | str:
        """Return a CAN-ID, or either of the two words."""
        return text.lower() if text.lower() in ("auto", "keep") else parse_cob_id(text)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """The two words."""
        items = {"auto": "pre-defined connection set for PDOs 1-4, else the next free CAN-ID", "keep": "as it is now"}
        return [CompletionItem(word, help=text) for word, text in items.items() if word.startswith(incomplete)]


class TransmissionType(NumberType):
    """A transmission type 0…255; the menu offers the most common."""

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


PDO, COB_ID = PdoType(), CobIdType()
