"""Find nodes without a node-ID, give them one and store it, by LSS (CiA 305)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.commands._lss_words import (
    address_or_ranges,
    no_words,
    node_id_and_address,
    node_or_address,
    one_file,
    only_node_id,
    rate_and_file,
)
from dvtcli.cli.effect import Effect, Final
from dvtcli.cli.params import TEXT, NumberType

if TYPE_CHECKING:
    from dvtcli.operations.results.lss_nodes import LssBitRate, LssChanged, LssFound
    from dvtcli.operations.session.session import Session

_ACTIONS = ("scan", "identify", "select", "node-id", "store", "assign", "bitrate")


def _final(params: Mapping[str, Any]) -> Final | None:
    """No undo takes a node-ID back."""
    return Final(f"lss {params['action']}") if params["action"] in ("node-id", "store", "assign", "bitrate") else None


@click.command("lss", cls=DvtCommand, short_help=__doc__, effect=Effect.COMMANDS, final=_final)
@click.argument("action", type=click.Choice(_ACTIONS), metavar="|".join(_ACTIONS))
@click.argument("words", type=TEXT, nargs=-1, metavar="[NODE|FILE|RATE] [vendor=… product=… revision=… serial=…]")
@click.option("--wait", type=NumberType(5, 2000, "a time in ms"), metavar="MS", help="scan: per question [50].")
@click.option("--store", "stores", is_flag=True, help="assign, bitrate: store it, too, once all came up.")
@click.option("--prove", is_flag=True, help="store, assign/bitrate --store: reset the nodes then, and look again.")
@click.pass_obj
def command(
    session: Session, /, action: str, words: tuple[str, ...], wait: int | None, stores: bool, prove: bool
) -> LssFound | LssChanged | LssBitRate:
    """Speak to nodes as LSS master.

    `scan` finds all nodes without a node-ID by fast scan, `identify` asks only whether there are any. `select` lets one
    node be configured. `node-id` gives a node its node-ID, and is done once the node is seen with it; `store` lets it
    keep that. `assign` does it for the nodes of a network file that have none or a wrong one, by their identity there.
    `bitrate` lets the whole bus run at another bit rate: every node on it is told, or none. These four ask first.

    \b
    lss scan
    lss scan --wait 200      for slow nodes
    lss identify
    lss identify vendor=0x1E product=0x705302D serial=0x10000-0x1FFFF      whether one within that is there
    lss select vendor=0x1E product=0x705302D revision=0x30000 serial=0x12345
    lss select 5             by what node 5 says of itself (0x1018)
    lss node-id 5            of the selected node
    lss node-id 5 vendor=0x1E product=0x705302D revision=0x30000 serial=0x12345
    lss store 5
    lss store 5 --prove      reset it, and look again
    lss assign press.yaml --store
    lss bitrate 250k
    lss bitrate 250k press.yaml --store      refused unless just its nodes are there
    lss bitrate 250k --store --prove         all are reset then, and seen at it again
    """
    from dvtcli.operations.lss import lss_assign, lss_bit_rate, lss_find, lss_node_id, lss_store

    _refuse_options(action, waits=wait is not None, stores=stores, proves=prove)
    match action:
        case "scan":
            no_words(words)
            return lss_find.lss_scan(session) if wait is None else lss_find.lss_scan(session, wait / 1000)
        case "identify":
            return lss_find.lss_identify(session, address_or_ranges(words) if words else None)
        case "select":
            return lss_find.lss_select(session, node_or_address(words))
        case "node-id":
            return lss_node_id.lss_node_id(session, *node_id_and_address(words))
        case "assign":
            return lss_assign.lss_assign(session, one_file(words), stores=stores, prove=prove)
        case "bitrate":
            return lss_bit_rate.lss_bit_rate(session, *rate_and_file(words), stores=stores, prove=prove)
    return lss_store.lss_store(session, only_node_id(words), prove=prove)


def _refuse_options(action: str, *, waits: bool, stores: bool, proves: bool) -> None:
    """UsageError for an option that belongs to another *action*."""
    if waits and action != "scan":
        raise click.UsageError("--wait belongs to lss scan")
    if stores and action not in ("assign", "bitrate"):
        raise click.UsageError("--store belongs to lss assign and lss bitrate")
    if proves and not (action == "store" or stores):
        raise click.UsageError("--prove belongs to lss store, and to lss assign and lss bitrate with --store")
