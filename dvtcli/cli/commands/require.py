"""Stop a script before any write if the node is another device, or its power stage is on."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import click
from click.shell_completion import CompletionItem

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import TEXT, CanopenType
from dvtcli.domain.datatypes import parse_number

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.results import Facts

_PARTS = ("vendor", "product", "revision", "serial")
_IDENTITY, _POWER_OFF = "identity", "power-off"


class Requirement(NamedTuple):
    """`identity` or `power-off`, and the node-ID, None for the selected node."""

    node_id: int | None
    what: str


class _Required(CanopenType):
    """A requirement, with its node if named: `identity`, `5:power-off`."""

    name = "what"

    def parse(self, text: str, ctx: click.Context | None) -> Requirement:
        """The requirement; ValueError for anything else."""
        del ctx
        node, colon, what = text.rpartition(":")
        if what not in (_IDENTITY, _POWER_OFF):
            raise ValueError(f"{text!r} is not {_IDENTITY!r} or {_POWER_OFF!r}")
        node_id = parse_number(node) if colon else None
        if node_id is not None and not 1 <= node_id <= 127:
            raise ValueError(f"{text!r}: a node-ID is 1..127")
        return Requirement(node_id, what)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Both words."""
        del ctx, param
        return [CompletionItem(word) for word in (_IDENTITY, _POWER_OFF) if word.startswith(incomplete)]


@click.command("require", cls=DvtCommand, short_help=__doc__, effect=Effect.SELECTS)
@click.argument("what", type=_Required(), metavar="[NODE:]identity|power-off")
@click.argument("pairs", type=TEXT, nargs=-1, metavar="[vendor=… product=… revision=… serial=…]")
@click.pass_obj
def command(session: Conversation, /, what: Requirement, pairs: tuple[str, ...]) -> Facts:
    """Stop with exit code 6 unless the node's identity (0x1018) is the one given, or its power stage (0x6041) is off.

    \b
    require identity vendor=0x1E product=0x0705302D
    require identity vendor=0x1E serial=0x12345      this very device
    require power-off                                a drive that cannot move
    """
    from dvtcli.errors import DvtcliError
    from dvtcli.operations.session.consent import require_identity, require_power_off

    node_id, word = what
    wanted = tuple(map(_pair, pairs))
    if word == _POWER_OFF and wanted:
        raise click.UsageError(f"require {word} takes no more words")
    if word == _IDENTITY and not wanted:
        raise click.UsageError(f"require {word} needs vendor=…, product=…, revision=… or serial=…")
    try:
        if word == _POWER_OFF:
            return require_power_off(session, node_id)
        return require_identity(session, wanted, node_id)
    except DvtcliError:  # a node that does not answer may be another, or have its power stage on
        session.requirement_failed = True
        raise


def _pair(text: str) -> tuple[str, int]:
    name, equals, number = text.partition("=")
    if not equals or name not in _PARTS:
        raise click.UsageError(f"{text!r}: write vendor=…, product=…, revision=… or serial=…")
    try:
        return name, parse_number(number)
    except ValueError as wrong:
        raise click.UsageError(f"{text!r}: {wrong}") from wrong
