"""Serve the bus to programs that speak CiA 309-3, a gateway in ASCII lines over TCP."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import TEXT

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.results.frames import GatewayEvent


@click.command("gateway", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE)
@click.option(
    "--listen",
    type=TEXT,
    multiple=True,
    metavar="HOST:PORT|unix:PATH",
    help="Address to listen on [127.0.0.1:60000]; port 0: a free port; repeatable.",
)
@click.option("--allow-changes", is_flag=True, help="Let clients write, send NMT commands and set node-IDs.")
@click.option("--any-user", is_flag=True, help="Also admit programs of other users (Linux).")
@click.option(
    "--dialect",
    type=click.Choice(["hash", "paren"]),
    default="hash",
    help="Errors as `ERROR:0x06020000 #text` (hash) or `ERROR: 06020000 (text)` (paren) [hash].",
)
@click.pass_obj
def command(
    session: Conversation, /, listen: tuple[str, ...], allow_changes: bool, any_user: bool, dialect: str
) -> None:
    """Serve a CANopen gateway until Ctrl-C: SDO, NMT, settings, PDOs and LSS, in the lines of CiA 309-3.

    Only programs on this computer can reach it, on Linux only those of the same user; a Unix socket is its user's
    alone. Clients may read; with --allow-changes their writes are done as by `write`: checked, read back, rolled back
    if the value differs. --yes answers questions, else they are refused. stderr shows connections and
    writes.

    \b
    gateway
    gateway --listen 127.0.0.1:0 --allow-changes
    gateway --listen unix:gateway.sock
    gateway --dialect paren
    gateway --allow-changes --dry-run     clients change a twin
    """
    from dvtcli.domain.gateway_words import Dialect
    from dvtcli.operations.gateway.serve_gateway import DEFAULT_PORT, listen_address, serve_gateway
    from dvtcli.operations.session.serve import LOOPBACK

    output = session.output

    def told(event: GatewayEvent) -> None:
        if output.json:
            output.told(event.document())
        elif event.event == "warning":
            output.warning(event.text)
        else:
            output.note(event.text)

    where = [listen_address(address) for address in listen]
    serve_gateway(
        session,
        where or [(LOOPBACK, DEFAULT_PORT)],
        output.result,
        allow_changes=allow_changes,
        any_user=any_user,
        dialect=Dialect(dialect),
        told=told,
    )
