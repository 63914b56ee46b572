"""Find nodes by LSS: without node-ID, or by address. Changes nothing permanently."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.lss_master import SCAN_S, LssMaster
from dvtcli.device.read_pdos import read_identity
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.lss_services import BITS, PARTS, LssAddress, LssRanges
from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.domain.objects import DEVICE_TYPE
from dvtcli.domain.text import plural
from dvtcli.errors import DeviceRefused, NoAnswer, SafetyRefusal, SdoAborted, SdoProtocolError, UsageError
from dvtcli.operations.results.lss_nodes import LssFound, LssNode

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    from dvtcli.domain.ports import CanopenBus
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser


def lss_bus(session: SessionNodes) -> CanopenBus:
    """Return the bus; raises UsageError if it carries no frames."""
    bus = session.open_network().bus
    if not bus.carries_frames:
        raise UsageError(f"{bus.name} has no CAN frames, so LSS is not possible", hint="open a CAN interface")
    return bus


def lss_scan(session: SessionNodes, wait_s: float = SCAN_S) -> LssFound:
    """Find all nodes without node-ID by fast scan, lowest address first, each confirmed by its address.

    *wait_s* is the time-out of a request in seconds. Raises NoAnswer for contradicting answers. All nodes return to the
    LSS state waiting. A dry run sends nothing.
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


def scanned(session: SessionUser, master: LssMaster) -> list[LssNode]:
    """Return the result of `lss_scan`."""
    found: list[LssAddress] = []

    def on_bit(bits: int) -> None:
        session.reporter.progress(f"LSS fast scan: {plural(len(found), 'node')} found", bits, BITS * PARTS)

    master.let_wait()
    while (address := master.scan(found, on_bit)) is not None:
        found.append(address)
        session.reporter.progress(f"LSS fast scan: found {address}", 0, 0)
    return [
        LssNode(lss_address, UNCONFIGURED, master.select(lss_address) == 1, _family(lss_address))
        for lss_address in found
    ]


def lss_select(session: SessionNodes, who: LssAddress | int, *, keep: bool = True) -> LssFound:
    """Select the single node with the address or node-ID *who* for configuration.

    *keep* leaves it selected for later orders; otherwise it returns to the LSS state waiting. The address of a node-ID
    is read by SDO (0x1018). Raises NoAnswer if no node has it, DeviceRefused if several have, SafetyRefusal for an
    incomplete address.
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
    """Select the single node with *address*; returns its node-ID, 255 for none.

    Raises NoAnswer if no node has the address, DeviceRefused if several have.
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
            f"the node with {address} does not return its identity",
            hint=Hint(Action.LSS_SCAN, why="lists the nodes on the bus"),
        )
    return said[1]


def two_alike(address: LssAddress) -> DeviceRefused:
    """Make the error for several nodes with the same address."""
    return DeviceRefused(
        f"more than one node answers to {address}", why="LSS cannot select one of several nodes with the same identity",
        hint="connect only one of them at a time, and give it its node-ID",
    )  # fmt: skip


def lss_identify(session: SessionNodes, address: LssAddress | LssRanges | None = None) -> LssFound:
    """Ask for nodes without node-ID, or for any node with *address*, or within a range of addresses.

    A dry run sends nothing.
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
    from dvtcli.files.profiles import profile_for_identity

    return profile_for_identity(address.vendor, address.product).name


#: 0x1018:1..4 of a node; None for missing numbers.
Identity = tuple[int | None, ...]
#: attempts to identify a node
_ASKED = 3
#: time-out of a node-ID that may be unused (s)
_ANSWER_S = 0.05


def answers(bus: CanopenBus, node_id: int) -> bool:
    """Tell whether SDO requests to *node_id* are answered, even with nonsense."""
    try:
        bus.sdo(node_id).upload(DEVICE_TYPE, 0)
    except NoAnswer:
        return False
    except (SdoAborted, SdoProtocolError):
        return True
    return True


def identity_on(bus: CanopenBus, node_id: int) -> Identity | None:
    """Read 0x1018 of *node_id*, None without an answer, after retries."""
    for _ in range(_ASKED):
        with suppress(NoAnswer, SdoProtocolError):
            return tuple(read_identity(bus.sdo(node_id), sub_index) for sub_index in (1, 2, 3, 4))
    return None


def who_is_there(bus: CanopenBus, received: Collection[int]) -> dict[int, Identity | None]:
    """Read 0x1018 of every node-ID that was *received* or answers; None if unreadable."""
    found: dict[int, Identity | None] = {}

    def ask(node_id: int) -> None:
        if _answers_soon(bus, node_id) or node_id in received:
            found[node_id] = identity_on(bus, node_id)

    def asking(node_id: int) -> Callable[[], None]:
        return lambda: ask(node_id)

    for failed in bus.side_by_side([asking(node_id) for node_id in range(1, 128)]):
        raise failed
    return dict(sorted(found.items()))


def free_node_id(bus: CanopenBus) -> int | None:
    """Return the lowest node-ID (1..127) not heard and without SDO answer; None if there is none."""
    received = bus.nodes_seen()
    silent = (node_id for node_id in range(1, 128) if node_id not in received and not _answers_soon(bus, node_id))
    return next((node_id for node_id in silent if not answers(bus, node_id)), None)


def _answers_soon(bus: CanopenBus, node_id: int) -> bool:
    try:
        bus.sdo(node_id).upload(DEVICE_TYPE, 0, timeout_s=_ANSWER_S, retries=0)
    except NoAnswer:
        return False
    except (SdoAborted, SdoProtocolError):
        pass  # somebody is there
    return True


def require_on(bus: CanopenBus, address: LssAddress, node_id: int) -> None:
    """Raises NoAnswer if *node_id* does not answer, SafetyRefusal if its 0x1018 does not fit *address*."""
    identity = identity_on(bus, node_id)
    if identity is None:
        raise NoAnswer(f"{address} did not start as node {node_id}", node=node_id)
    if not _is(identity, address):
        raise SafetyRefusal(
            f"node {node_id} is another device than the one with {address}", node=node_id,
            why=f"its 0x1018 is {in_words(identity)}",
        )  # fmt: skip


def is_on(bus: CanopenBus, address: LssAddress, node_id: int) -> bool:
    """Tell whether the node with *address* answers SDO as *node_id*."""
    identity = identity_on(bus, node_id)
    return identity is not None and _is(identity, address)


def in_words(identity: Identity) -> str:
    """Print 0x1018, missing numbers as `-`."""
    return " ".join("-" if part is None else f"0x{part:X}" for part in identity)


def _is(identity: Identity, address: LssAddress) -> bool:
    """Tell whether 0x1018 fits *address*: its vendor, and every other number present."""
    told = zip(identity, address.parts, strict=True)
    return identity[0] is not None and all(part in (None, wanted) for part, wanted in told)


def address_of(bus: CanopenBus, node_id: int) -> LssAddress:
    """Return the LSS address of *node_id* by 0x1018; raises NoAnswer, SafetyRefusal if incomplete."""
    identity = identity_on(bus, node_id)
    if identity is None:
        raise NoAnswer(
            f"node {node_id} does not answer",
            node=node_id,
            hint=Hint(Action.FIND_NODES, why="lists the nodes on the bus"),
        )
    vendor, product, revision, serial = identity
    if vendor is None or product is None or revision is None or serial is None:
        raise SafetyRefusal(
            f"node {node_id} has no readable LSS address (0x1018:1..4)", node=node_id,
            hint="without vendor, product, revision and serial number no LSS master can select it",
        )  # fmt: skip
    return LssAddress(vendor, product, revision, serial)
