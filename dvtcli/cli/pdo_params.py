"""Click types of a PDO and its communication parameters; completion uses PDOs already read, no bus."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from dvtcli.cli.params import CanopenType, NumberType
from dvtcli.domain.datatypes import parse_number
from dvtcli.domain.object_syntax import (
    parse_cob_id,
)
from dvtcli.domain.pdo import Direction, Pdo, transmission_type_text

if TYPE_CHECKING:
    from dvtcli.operations.session.session import SessionNodes


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

        def text(kind: int) -> str:
            sent, taken = (transmission_type_text(kind, way) for way in (Direction.TPDO, Direction.RPDO))
            return sent if sent == taken else f"{sent}; RPDO: {taken}"

        kinds = [kind for kind in (1, 2, 4, 10, 0, 254, 255) if str(kind).startswith(incomplete)]
        return [CompletionItem(str(kind), help=text(kind)) for kind in kinds]


PDO, COB_ID = PdoType(), CobIdType()
