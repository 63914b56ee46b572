"""Finding nodes by LSS: those without a node-ID, and the one that has an address. Changes nothing that is kept."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.lss_master import SCAN_S, LssMaster
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.lss_services import BITS, PARTS, LssAddress, LssRanges
from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.domain.several import plural
from dvtcli.errors import DeviceRefused, NoAnswer, UsageError
from dvtcli.operations.lss.lss_identity import address_of, free_node_id
from dvtcli.operations.results.lss_nodes import LssFound, LssNode

if TYPE_CHECKING:
    from dvtcli.domain.ports import CanopenBus
    from dvtcli.operations.session.session import Session


def lss_bus(session: Session) -> CanopenBus:
    """The bus itself; UsageError where it carries no frames."""
    bus = session.open_network().bus
    if not bus.carries_frames:
        raise UsageError(f"{bus.name} carries no CAN frames, so that no LSS either", hint="open a CAN interface")
    return bus


def lss_scan(session: Session, wait_s: float = SCAN_S) -> LssFound:
    """Find every node without a node-ID by fast scan, lowest address first; each is confirmed by its address.

    A question waits *wait_s* seconds for its answer. NoAnswer where the answers do not fit together. Afterwards all
    nodes wait as before. Nothing is sent in a dry run.
    """
    if session.dry_run:
        return LssFound("scan", dry_run=True)
    bus = lss_bus(session)
    began_s = bus.now_s()
    with LssMaster(bus, wait_s) as master:
        nodes = scanned(session, master)
        answered = len(nodes) or master.unconfigured()
    free = free_node_id(bus) if nodes else None
    return LssFound("scan", tuple(nodes), answered, master.requests, bus.now_s() - began_s, free=free)


def scanned(session: Session, master: LssMaster) -> list[LssNode]:
    """What `lss_scan` finds."""
    found: list[LssAddress] = []

    def on_bit(bits: int) -> None:
        session.tell.progress(f"LSS fast scan: {plural(len(found), 'node')} found", bits, BITS * PARTS)

    master.let_wait()
    while (address := master.scan(found, on_bit)) is not None:
        found.append(address)
        session.tell.progress(f"LSS fast scan: found {address}", 0, 0)
    return [
        LssNode(lss_address, UNCONFIGURED, master.select(lss_address) == 1, _family(lss_address))
        for lss_address in found
    ]


def lss_select(session: Session, who: LssAddress | int, *, keep: bool = True) -> LssFound:
    """Let the node with the address *who* be configured, alone, or that with this node-ID.

    It stays so for others, or waits again where it is not to *keep*.
    Of a node-ID the address is what its 0x1018 says by SDO. NoAnswer where nobody has it, DeviceRefused where several
    have, SafetyRefusal where it does not tell its whole address.
    """
    if session.dry_run:
        return LssFound("select", dry_run=True)
    bus = lss_bus(session)
    began_s = bus.now_s()
    address = address_of(bus, who) if isinstance(who, int) else who
    with LssMaster(bus) as master:
        node_id = selected(master, address)
        if keep:
            master.keep_selected()
    node = LssNode(address, node_id, profile=_family(address))
    return LssFound("select", (node,), None, master.requests, bus.now_s() - began_s)


def selected(master: LssMaster, address: LssAddress) -> int:
    """Let the node with *address* be configured, alone; its node-ID, 255 for none.

    NoAnswer where nobody has that address, DeviceRefused where several have.
    """
    answers = master.select(address)
    if not answers:
        raise NoAnswer(
            f"no node answers to {address}",
            hint=Hint(Action.LSS_SCAN, why="finds nodes without a node-ID")
            + Hint(Action.FIND_NODES, why="those that have one"),
        )
    if answers > 1:
        raise two_alike(address)
    said = master.inquire()
    if said is None or said[0] != address:
        raise NoAnswer(
            f"the node with {address} does not tell who it is", hint=Hint(Action.LSS_SCAN, why="shows who is there")
        )
    return said[1]


def two_alike(address: LssAddress) -> DeviceRefused:
    """What is to be said where several nodes have one address."""
    return DeviceRefused(
        f"more than one node answers to {address}", why="nodes with one identity cannot be told apart by LSS",
        hint="connect them one at a time, and give each its node-ID",
    )  # fmt: skip


def lss_identify(session: Session, address: LssAddress | LssRanges | None = None) -> LssFound:
    """Ask whether nodes without a node-ID are there, or one with *address*, or within it, whatever its node-ID.

    Nothing is sent in a dry run.
    """
    if session.dry_run:
        return LssFound("identify", dry_run=True)
    bus = lss_bus(session)
    began_s = bus.now_s()
    with LssMaster(bus) as master:
        if address is None:
            found = LssFound("identify", (), master.unconfigured())
        elif isinstance(address, LssRanges):
            found = LssFound("identify", within=master.is_within(address))
        else:
            answers = master.select(address)
            node_id = selected(master, address) if answers == 1 else None
            nodes = (LssNode(address, node_id, answers == 1, _family(address)),) if answers else ()
            found = LssFound("identify", nodes, None)
        return replace(found, requests=master.requests, seconds=bus.now_s() - began_s)


def _family(address: LssAddress) -> str:
    from dvtcli.files.profile.library import profile_for_identity

    return profile_for_identity(address.vendor, address.product).name
