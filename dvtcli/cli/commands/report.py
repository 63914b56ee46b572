"""Draw a network as an HTML page with wiring, layouts, load and findings, or its wiring as SVG or Graphviz."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import FILE, TEXT, BitRateType, DurationType

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import Session


@click.command("report", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE)
@click.argument("out", type=FILE)
@click.argument("file", type=FILE, required=False)
@click.option("--title", type=TEXT, help="Title of the page [the name of FILE, or of the bus].")
@click.option(
    "--at", "bit_rate", type=BitRateType(), metavar="BIT/S", help="The bus's bit rate [its own, or the file's]."
)
@click.option(
    "--for",
    "for_s",
    type=DurationType(0, 3600),
    metavar="TIME",
    help="Time to receive from the bus [2s]; 0: none.",
)
@click.pass_obj
def command(
    session: Session, /, out: str, file: str | None, title: str | None, bit_rate: int | None, for_s: float | None
) -> Facts:
    """Write a network to OUT: a page (.html), or its wiring alone (.svg, .dot for Graphviz).

    Without a bus, the network of FILE, as check and load see it. With a bus, the nodes on it, compared with FILE. The
    page is one file that loads nothing else and has no date: the same network gives the same bytes. It can be sorted,
    printed, and read on a phone.

    \b
    report line.html line.yaml
    report line.html line.yaml --title "Line 3, as delivered"
    report line.svg line.yaml      its wiring alone
    report line.dot line.yaml      for Graphviz: dot -Tpdf line.dot
    report now.html                the nodes on the bus
    report now.html press.yaml     with the differences from FILE
    """
    from dvtcli.operations.network.draw_network import PictureOptions, draw_network

    return draw_network(session, out, file, PictureOptions(title, bit_rate, for_s))
