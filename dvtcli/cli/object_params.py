"""Click types of objects, PDOs and their parameters; completion uses PDOs already read, no bus."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from dvtcli.cli.params import CanopenType, Listed
from dvtcli.domain.datatypes import BY_SHORT_NAME
from dvtcli.domain.object_syntax import (
    AmbiguousName,
    MappedObject,
    Skipped,
    UnknownName,
    notation_note,
    parse_object,
    resolve_entry,
    resolve_object,
)
from dvtcli.errors import UsageError
from dvtcli.operations.values.named_objects import entry_at, is_name, name_hint, object_at, one_name

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.device.node_parts import NodeDescription
    from dvtcli.domain.pdo import Direction


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
    #: of the PDO on the line
    direction: Direction | None = None

    @property
    def notation_note(self) -> str | None:
        """A remark on the notation, or None."""
        return notation_note(self.text)

    def resolve(self, node: NodeDescription) -> MappedObject | Skipped:
        """Return the object and its length, or the bits to skip. Raises UsageError for an unknown name."""
        return entry_at(node, self.text, self.direction)


class ObjectParam(CanopenType):
    """An object: `0x6C01:1`, `6041`, `statusword`, `"Analogue input.Channel 1"`."""

    name = "object"
    entry = False

    def parse(self, text: str, ctx: click.Context | None) -> ObjectWord | EntryWord:
        """The word; UsageError for a name that no known dictionary has, before anything is sent."""
        if not self.entry:
            parse_object(text)
        session = ctx.find_root().obj if ctx is not None else None
        chosen = ctx.params.get("pdo") if ctx is not None and self.entry else None
        direction = getattr(getattr(chosen, "pdo", None), "direction", None)
        if session is not None and ctx is not None and not ctx.resilient_parsing:
            self._check_name(text, session, direction)
        return EntryWord(text, direction) if self.entry else ObjectWord(text)

    def _check_name(self, text: str, session: Conversation, direction: Direction | None) -> None:
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
            failure.direction = direction
            raise UsageError(str(failure), hint=name_hint(failure)) from failure
        if isinstance(failure, AmbiguousName):
            raise UsageError(str(failure)) from failure
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
        """Return the words. Raises BadParameter if a word names no object, UsageError if no dictionary has its name."""
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
