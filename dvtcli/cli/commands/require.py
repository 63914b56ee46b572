"""Require an identity: in scripts, stop before anything is written if the node is another."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.params import TEXT
from dvtcli.domain.datatypes import parse_number

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session import Session

_SUB_INDICES = {"vendor": 1, "product": 2, "revision": 3, "serial": 4}


@click.command("require", cls=DvtCommand, short_help=__doc__)
@click.argument("what", type=click.Choice(["identity"]), metavar="identity")
@click.argument("pairs", type=TEXT, nargs=-1, required=True, metavar="vendor=… product=… [revision=…] [serial=…]")
@click.pass_obj
def command(session: Session, /, what: str, pairs: tuple[str, ...]) -> Facts:
    """Stop with exit code 6 unless the node's identity (0x1018) is the one given.

    \b
    require identity vendor=0x1E product=0x0705302D
    require identity vendor=0x1E serial=0x12345      this very device
    """
    from dvtcli.device.read_pdos import read_identity
    from dvtcli.errors import SafetyRefusal
    from dvtcli.operations.results import Facts

    node = session.node()
    held = {name: read_identity(node.sdo, sub_index) for name, sub_index in _SUB_INDICES.items()}
    for name, wanted in map(_pair, pairs):
        if held[name] != wanted:
            has = "none" if held[name] is None else f"0x{held[name]:08X}"
            raise SafetyRefusal(
                f"node {node.node_id} is another device: {name} is {has}, the script wants 0x{wanted:08X}",
                node=node.node_id,
                place=f"1018:{_SUB_INDICES[name]:02X}",
                hint="is this the right node? scan lists them",
            )
    shown = ", ".join(f"{name} 0x{value:08X}" for name, value in map(_pair, pairs))
    return Facts("require", (("node", node.node_id), (what, held)), (f"node {node.node_id} is the one: {shown}",))


def _pair(text: str) -> tuple[str, int]:
    name, equals, number = text.partition("=")
    if not equals or name not in _SUB_INDICES:
        raise click.UsageError(f"{text!r}: write vendor=…, product=…, revision=… or serial=…")
    try:
        return name, parse_number(number)
    except ValueError as wrong:
        raise click.UsageError(f"{text!r}: {wrong}") from wrong
