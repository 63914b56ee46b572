"""Require an identity: in scripts, stop before anything is written if the node is another."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.effect import Effect
from dvtcli.cli.params import TEXT
from dvtcli.domain.datatypes import parse_number

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.results import Facts

TASK = ("Scripts and files", 30)

_PARTS = ("vendor", "product", "revision", "serial")


@click.command("require", cls=DvtCommand, short_help=__doc__, effect=Effect.SELECTS)
@click.argument("what", type=click.Choice(["identity"]), metavar="identity")
@click.argument("pairs", type=TEXT, nargs=-1, required=True, metavar="vendor=… product=… [revision=…] [serial=…]")
@click.pass_obj
def command(session: Conversation, /, what: str, pairs: tuple[str, ...]) -> Facts:
    """Stop with exit code 6 unless the node's identity (0x1018) is the one given.

    \b
    require identity vendor=0x1E product=0x0705302D
    require identity vendor=0x1E serial=0x12345      this very device
    """
    from dvtcli.errors import DvtcliError
    from dvtcli.operations.nodes.required_identity import require_identity

    del what
    wanted = tuple(map(_pair, pairs))
    try:
        return require_identity(session, wanted)
    except DvtcliError:  # one that does not say who it is may be another, too
        session.other_device = True
        raise


def _pair(text: str) -> tuple[str, int]:
    name, equals, number = text.partition("=")
    if not equals or name not in _PARTS:
        raise click.UsageError(f"{text!r}: write vendor=…, product=…, revision=… or serial=…")
    try:
        return name, parse_number(number)
    except ValueError as wrong:
        raise click.UsageError(f"{text!r}: {wrong}") from wrong
