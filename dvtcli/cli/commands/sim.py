"""Serve simulated nodes to other programs, on a socketcand port or on a bus."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.global_options import PREFIX
from dvtcli.cli.params import FILE, TEXT
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation


@click.command("sim", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE)
@click.argument("nodes", nargs=-1, required=True, metavar="NODE…")
@click.option(
    "--listen", type=TEXT, metavar="HOST:PORT", help="Address to listen on [127.0.0.1:29536]; port 0: a free port."
)
@click.option(
    "--state", type=FILE, metavar="DIR", help="Folder for the stored values (0x1010) of the nodes, for the next sim."
)
@click.option(
    "--latency",
    type=TEXT,
    multiple=True,
    metavar="[NODE:]MS",
    help="Time an SDO server takes to answer [0]; repeatable.",
)
@click.option("--ready-file", type=FILE, metavar="FILE", help="File that gets HOST:PORT when clients can connect.")
@click.pass_context
def command(
    ctx: click.Context,
    nodes: tuple[str, ...],
    listen: str | None,
    state: str | None,
    latency: tuple[str, ...],
    ready_file: str | None,
) -> None:
    """Serve each NODE (a family or an EDS/DCF file, @ID sets its node-ID, @255 leaves it to LSS) until Ctrl-C.

    Every program that speaks socketcand can connect: dvtcli, python-can, ... With -i/-c the nodes join that bus
    instead; with --listen as well, both. With -b frames take the time of their bits at that bit rate.

    \b
    sim gen4@1
    sim gen4@1 tmcm@5 --listen 127.0.0.1:0 --state kept
    sim gen4@1 tmcm@5 -b 125000 --latency 2 --latency 5:20
    sim gen4 --signal "606C=sine(1500,2s)"
    sim gen4 -i socketcan -c vcan0
    """
    from dvtcli.operations.nodes.serve_nodes import serve
    from dvtcli.operations.session.serve import DEFAULT_PORT, LOOPBACK, ServeRequest, address, latency_of

    session: Conversation = ctx.obj
    if _typed(ctx, "sim"):
        raise UsageError("--sim simulates a node in this process; name nodes to serve after `sim`", hint="sim gen4@1")
    join = any(_typed(ctx, name) for name in ("bus", "interface", "channel"))
    where = address(listen) if listen is not None else None if join else (LOOPBACK, DEFAULT_PORT)
    kept = None if state is None else Path(state)
    wanted = ServeRequest(nodes, where, join, kept, tuple(map(latency_of, latency)))
    ready = None if ready_file is None else Path(ready_file)
    serve(session, wanted, session.output.result, ready)


def _typed(ctx: click.Context, name: str) -> bool:
    """Whether a global option was typed: `sim` does not join a bus from a settings file."""
    contexts = [ctx] if ctx.parent is None else [ctx, ctx.parent]
    return any(context.get_parameter_source(PREFIX + name) is ParameterSource.COMMANDLINE for context in contexts)
