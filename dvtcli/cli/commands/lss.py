"""Find nodes without a node-ID, assign and store node-IDs, change the bit rate, by LSS (CiA 305)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.command import DvtCommand, Effect, Final
from dvtcli.cli.params import NODE_ID, TEXT, NumberType
from dvtcli.domain.datatypes import parse_number
from dvtcli.domain.lss_services import LssAddress, LssRanges
from dvtcli.errors import UsageError
from dvtcli.operations.user.options import bit_rate

if TYPE_CHECKING:
    from dvtcli.operations.results.lss_nodes import LssBitRate, LssChanged, LssFound
    from dvtcli.operations.session.session import Session


_PARTS = ("vendor", "product", "revision", "serial")
_HINT = "lss scan prints them: vendor=0x1E product=0x705302D revision=0x30000 serial=0x12345"


def no_words(words: tuple[str, ...]) -> None:
    """Raise UsageError if any words follow."""
    if words:
        raise UsageError(f"unexpected {words[0]}", hint="help lss")


def address_of_words(words: tuple[str, ...]) -> LssAddress:
    """Return the LSS address in *words*. Raises UsageError if a number is malformed, missing or repeated."""
    said = {name: _number(word, number) for name, (word, number) in _parts(words).items()}
    missing = [name for name in _PARTS if name not in said]
    if missing:
        raise UsageError(f"an LSS address has four numbers: {', '.join(missing)} missing", hint=_HINT)
    return LssAddress(**said)


def address_or_ranges(words: tuple[str, ...]) -> LssAddress | LssRanges:
    """Return the address in *words*, or ranges: `serial=LOW-HIGH`; an absent revision or serial means any."""
    said = _parts(words)
    if said.keys() == set(_PARTS) and not any("-" in number for _, number in said.values()):
        return address_of_words(words)
    missing = [name for name in _PARTS[:2] if name not in said]
    if missing:
        raise UsageError(f"lss identify takes a vendor and a product: {', '.join(missing)} missing", hint=_HINT)
    vendor, product = (_number(*said[name]) for name in _PARTS[:2])
    revision, serial = (_range(*said[name]) if name in said else (0, 0xFFFFFFFF) for name in _PARTS[2:])
    return LssRanges(vendor, product, revision, serial)


def _parts(words: tuple[str, ...]) -> dict[str, tuple[str, str]]:
    """Return the words by name of a part, each with its value."""
    said: dict[str, tuple[str, str]] = {}
    for word in words:
        name, equals, number = word.partition("=")
        if not equals or name not in _PARTS:
            raise UsageError(f"{word}: write vendor=… product=… revision=… serial=…", hint=_HINT)
        if name in said:
            raise UsageError(f"{name} was given twice", hint=_HINT)
        said[name] = word, number
    return said


def _number(word: str, number: str) -> int:
    try:
        said = parse_number(number)
    except ValueError as wrong:
        raise UsageError(f"{word}: {wrong}", hint=_HINT) from wrong
    if not 0 <= said <= 0xFFFFFFFF:
        raise UsageError(f"{word}: a number of 32 bits is 0…0xFFFFFFFF", hint=_HINT)
    return said


def _range(word: str, said: str) -> tuple[int, int]:
    low, dash, high = said.partition("-")
    ends = _number(word, low), _number(word, high if dash else low)
    if ends[0] > ends[1]:
        raise UsageError(f"{word}: the lower number first", hint="serial=0x10000-0x1FFFF")
    return ends


def node_id_and_address(words: tuple[str, ...]) -> tuple[int, LssAddress | None]:
    """Return the node-ID, and the address after it if given."""
    if not words:
        raise UsageError("lss node-id needs the node-ID", hint="lss node-id 5")
    return _node_id(words[0]), address_of_words(words[1:]) if words[1:] else None


def node_or_address(words: tuple[str, ...]) -> LssAddress | int:
    """Return the node as node-ID or address."""
    return _node_id(words[0]) if len(words) == 1 and "=" not in words[0] else address_of_words(words)


def only_node_id(words: tuple[str, ...]) -> int | None:
    """Return the node-ID, None if absent."""
    no_words(words[1:])
    return _node_id(words[0]) if words else None


def one_file(words: tuple[str, ...]) -> str:
    """Return the network file."""
    if len(words) != 1:
        raise UsageError("lss assign takes one network file", hint="lss assign press.yaml")
    return words[0]


def rate_and_file(words: tuple[str, ...]) -> tuple[int, str | None]:
    """Return the bit rate (bit/s), written `500k` or `500000`, and the network file after it if given."""
    if not 1 <= len(words) <= 2:
        raise UsageError("lss bitrate takes a bit rate and, optionally, a network file", hint="lss bitrate 500k")
    return bit_rate(words[0]), words[1] if len(words) == 2 else None


def _node_id(word: str) -> int:
    try:
        return NODE_ID.parse(word, None)
    except ValueError as wrong:
        raise UsageError(str(wrong), hint="lss node-id 5") from wrong


_ACTIONS = ("scan", "identify", "select", "node-id", "store", "assign", "bitrate")


def _final(params: Mapping[str, Any]) -> Final | None:
    """No undo takes a node-ID back."""
    return Final(f"lss {params['action']}") if params["action"] in ("node-id", "store", "assign", "bitrate") else None


@click.command("lss", cls=DvtCommand, short_help=__doc__, effect=Effect.COMMANDS, final=_final)
@click.argument("action", type=click.Choice(_ACTIONS), metavar="|".join(_ACTIONS))
@click.argument("words", type=TEXT, nargs=-1, metavar="[NODE|FILE|RATE] [vendor=… product=… revision=… serial=…]")
@click.option(
    "--wait",
    type=NumberType(5, 2000, "a time in ms"),
    metavar="MS",
    help="scan: milliseconds to wait for each answer [50].",
)
@click.option("--store", "stores", is_flag=True, help="assign, bitrate: also store it, after all nodes have started.")
@click.option("--prove", is_flag=True, help="store, assign/bitrate --store: reset the nodes and check them.")
@click.pass_obj
def command(
    session: Session, /, action: str, words: tuple[str, ...], wait: int | None, stores: bool, prove: bool
) -> LssFound | LssChanged | LssBitRate:
    """Configure nodes as LSS master.

    `scan` finds all nodes without a node-ID by fast scan; `identify` asks only whether there are any. `select` selects
    one node. `node-id` gives a node its node-ID and checks that it answers there; `store` lets it keep that. `assign`
    does this for the nodes of a network file that have none or a wrong one, by their identity there. `bitrate` changes
    the bit rate of every node on the bus, or of none. These four ask first.

    \b
    lss scan
    lss scan --wait 200      for slow nodes
    lss identify
    lss identify vendor=0x1E product=0x705302D serial=0x10000-0x1FFFF      is there a node within these ranges?
    lss select vendor=0x1E product=0x705302D revision=0x30000 serial=0x12345
    lss select 5             by node 5's own identity (0x1018)
    lss node-id 5            of the selected node
    lss node-id 5 vendor=0x1E product=0x705302D revision=0x30000 serial=0x12345
    lss store 5
    lss store 5 --prove      reset it, and look again
    lss assign press.yaml --store
    lss bitrate 250k
    lss bitrate 250k press.yaml --store      refused unless just its nodes are there
    lss bitrate 250k --store --prove         all are reset then, and seen at it again
    """
    from dvtcli.operations.lss import lss_assign, lss_bit_rate, lss_find, lss_node_id

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
    return lss_node_id.lss_store(session, only_node_id(words), prove=prove)


def _refuse_options(action: str, *, waits: bool, stores: bool, proves: bool) -> None:
    """Raise UsageError for an option of another *action*."""
    if waits and action != "scan":
        raise click.UsageError("--wait belongs to lss scan")
    if stores and action not in ("assign", "bitrate"):
        raise click.UsageError("--store belongs to lss assign and lss bitrate")
    if proves and not (action == "store" or stores):
        raise click.UsageError("--prove belongs to lss store, and to lss assign and lss bitrate with --store")
