"""Giving a node its node-ID by LSS, seen on the new one before anything is called done; and storing it.

Does not know files, nor how the node was found.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.lss_master import LssMaster
from dvtcli.device.read_pdos import read_identity
from dvtcli.domain.lss_services import LssAddress
from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.errors import DvtcliError, LeftChanged, NoAnswer, SafetyRefusal, SdoAborted, SdoProtocolError, UsageError
from dvtcli.operations.lss_find import lss_bus, selected
from dvtcli.operations.other_master import refuse_other_master
from dvtcli.operations.reset_consent import consent_to_reset
from dvtcli.operations.results.lss_nodes import LssChanged, LssGiven

if TYPE_CHECKING:
    from dvtcli.domain.ports import CanopenBus, Frame
    from dvtcli.operations.session import Session

#: How long a node may take to boot up with its new node-ID, and how often it is asked who it is after that (s).
BOOT_UP_S = 3.0
_ASKED = 3
_HEARTBEAT = 0x700


def lss_node_id(session: Session, node_id: int, address: LssAddress | None = None) -> LssChanged:
    """Give *node_id* (1..127) to the node with *address*, None: to the one that is selected.

    Asks first. Done once the node has booted up with it, and says by SDO that it is the one; where it does not come up,
    its old node-ID is given back. SafetyRefusal where *node_id* is in use, or another master is active; DeviceRefused,
    NoAnswer with state `rolled_back`; LeftChanged.
    """
    if session.dry_run:
        return LssChanged("node-id", wanted=node_id, dry_run=True)
    bus = lss_bus(session)
    with LssMaster(bus) as master:
        one, before = _meant(master, address)
        given = LssGiven(one, before, node_id)
        if before == node_id:
            _require_on(bus, given)
            return LssChanged("node-id", (given,))
        refuse_used(session, node_id)
        consent_to_give(session, [given])
        with session.cancellation.guard():
            give(session, master, given)
    return LssChanged("node-id", (given,))


def _meant(master: LssMaster, address: LssAddress | None) -> tuple[LssAddress, int]:
    """The node that is to be configured, and its node-ID; it is selected then."""
    if address is not None:
        return address, selected(master, address)
    said = master.inquire()
    if said is None:
        raise UsageError(
            "no node is selected by LSS",
            hint="lss select vendor=… product=… revision=… serial=…, or name these behind the node-ID; lss scan",
        )
    return said


def refuse_used(session: Session, node_id: int) -> None:
    """SafetyRefusal where *node_id* is heard or answers, or where another master is active."""
    heard = node_id in heard_ids(session)
    if heard or answers(session.bus, node_id):
        raise SafetyRefusal(
            f"node-ID {node_id} is in use: a node {'is heard' if heard else 'answers'} on it",
            node=node_id,
            hint=f"choose another one; node {node_id} shows who has it",
        )


def heard_ids(session: Session) -> set[int]:
    """The node-IDs of heartbeats and boot-ups, while another master is listened for; SafetyRefusal where one is."""
    heard: set[int] = set()

    def note(frame: Frame, sent: bool) -> None:
        if not sent and not frame.extended and 1 <= frame.can_id - _HEARTBEAT <= 127:
            heard.add(frame.can_id - _HEARTBEAT)

    stop = session.bus.tap(note)
    try:
        refuse_other_master(session)
    finally:
        stop()
    return heard


def answers(bus: CanopenBus, node_id: int) -> bool:
    """Whether somebody answers SDO requests as *node_id*, be it nonsense."""
    try:
        bus.sdo(node_id).upload(0x1000, 0)
    except NoAnswer:
        return False
    except (SdoAborted, SdoProtocolError):
        return True
    return True


def consent_to_give(session: Session, given: list[LssGiven], *, store: bool = False) -> None:
    """Ask before nodes get node-IDs; and for each that has one, and is a drive that may move, before its reset."""
    lines = [f"node-ID {one.node_id} to {one.name or one.address} (now {_id(one.before)})" for one in given]
    session.consent(f"give {'; '.join(lines)}{', and store' if store else ''}?")
    consent_to_reset(session, [one.before for one in given if one.before != UNCONFIGURED])


def _id(node_id: int) -> str:
    return "none" if node_id == UNCONFIGURED else str(node_id)


def give(session: Session, master: LssMaster, given: LssGiven) -> None:
    """Give a node that is selected its node-ID, and see that it comes up with it; else take it back."""
    bus = session.open_network().bus
    seen = bus.boot_ups(given.node_id)
    try:
        master.configure_node_id(given.node_id)
        activate(master, given.before)
        bus.wait_boot_up(given.node_id, seen, BOOT_UP_S)  # not heard: it may be there all the same
        _require_on(bus, given)
    except DvtcliError as failed:
        raise _taken_back(master, given, failed) from failed
    _forget(session, given)


def activate(master: LssMaster, before: int) -> None:
    """Let a node that is being configured take its new node-ID: its first one by waiting, another one by a reset."""
    master.let_wait()
    if before != UNCONFIGURED:
        master.reset_communication(before)


def _require_on(bus: CanopenBus, given: LssGiven) -> None:
    """NoAnswer where the node's address is not what *its* node-ID says at 0x1018, SafetyRefusal where another's is."""
    identity = identity_on(bus, given.node_id)
    if identity is None:
        raise NoAnswer(f"{given.address} did not come up as node {given.node_id}", node=given.node_id)
    if not _is(identity, given.address):
        raise SafetyRefusal(
            f"node {given.node_id} is another device than the one with {given.address}", node=given.node_id,
            why="its 0x1018 says " + " ".join("-" if part is None else f"0x{part:X}" for part in identity),
        )  # fmt: skip


def _is(identity: tuple[int | None, ...], address: LssAddress) -> bool:
    """Whether a 0x1018 is of *address*: its vendor, and every other number that it has."""
    told = zip(identity, address.parts, strict=True)
    return identity[0] is not None and all(part in (None, wanted) for part, wanted in told)


def identity_on(bus: CanopenBus, node_id: int) -> tuple[int | None, ...] | None:
    """What 0x1018 of *node_id* says, None where nobody answers, however often."""
    for _ in range(_ASKED):
        with suppress(NoAnswer, SdoProtocolError):
            return tuple(read_identity(bus.sdo(node_id), sub_index) for sub_index in (1, 2, 3, 4))
    return None


def _taken_back(master: LssMaster, given: LssGiven, failed: DvtcliError) -> DvtcliError:
    """*failed*, with the state that the node is in after its old node-ID was given back; LeftChanged where it was not.

    Seen by asking the node for its node-ID once more.
    """
    try:
        take_back(master, given)
    except DvtcliError as stuck:
        left = LeftChanged(
            f"{failed.text}, and its old node-ID cannot be given back", node=given.node_id, why=stuck.text,
            state="left_changed",
            hint="nothing is stored: switch it off and on, then lss scan; lss identify asks for its address",
        )  # fmt: skip
        left.details.append(("node", str(given.address)))
        return left
    failed.state = "rolled_back"
    failed.state_text = f"it has node-ID {_id(given.before)} as before, nothing is stored"
    failed.hint = failed.hint or "lss scan and scan show who is there"
    return failed


def take_back(master: LssMaster, given: LssGiven) -> None:
    """Give a node its old node-ID back, and see by LSS that it has it; raises where that is not so."""
    now = selected(master, given.address)
    master.configure_node_id(given.before)
    if now != given.before:
        activate(master, now)
        now = selected(master, given.address)
    master.let_wait()
    if now != given.before:
        raise NoAnswer(f"it says that its node-ID is {_id(now)}", state="unknown")


def _forget(session: Session, given: LssGiven) -> None:
    """Whoever has these node-IDs is met anew: what was read of them was another node's."""
    network = session.open_network()
    for node_id in (given.before, given.node_id):
        node = network.nodes.pop(node_id, None)
        if node is not None:
            node.let_go()
        network.files.forget(node_id)


def lss_store(session: Session, node_id: int | None = None) -> LssChanged:
    """Let the node with *node_id*, None: the selected one, keep its node-ID without power.

    Asks first. It is asked by SDO who it is, so that a node that did not come up with its node-ID stores none.
    DeviceRefused with its reason, NoAnswer, SafetyRefusal.
    """
    node_id = session.node_id() if node_id is None else node_id
    if session.dry_run:
        return LssChanged("store", wanted=node_id, dry_run=True)
    bus = lss_bus(session)
    address = address_of(bus, node_id)
    refuse_other_master(session)
    session.consent(f"store node-ID {node_id} in the node with {address}?", node_id)
    with LssMaster(bus) as master, session.cancellation.guard():
        return LssChanged("store", (store(master, LssGiven(address, node_id, node_id)),))


def address_of(bus: CanopenBus, node_id: int) -> LssAddress:
    """Who the node with *node_id* is by its 0x1018; NoAnswer, SafetyRefusal where it does not tell all four numbers."""
    identity = identity_on(bus, node_id)
    if identity is None:
        raise NoAnswer(f"node {node_id} does not answer", node=node_id, hint="scan shows who is there")
    vendor, product, revision, serial = identity
    if vendor is None or product is None or revision is None or serial is None:
        raise SafetyRefusal(
            f"node {node_id} does not tell its whole LSS address (0x1018:1..4)", node=node_id,
            hint="without vendor, product, revision and serial number no LSS master can select it",
        )  # fmt: skip
    return LssAddress(vendor, product, revision, serial)


def store(master: LssMaster, given: LssGiven) -> LssGiven:
    """Let a node that has its node-ID keep it; SafetyRefusal where it says that it has another one."""
    now = selected(master, given.address)
    if now != given.node_id:
        raise SafetyRefusal(
            f"the node with {given.address} has node-ID {_id(now)}, not {given.node_id}", node=given.node_id,
            hint="nothing was stored; scan shows who is there",
        )  # fmt: skip
    master.store()
    return replace(given, stored=True)
