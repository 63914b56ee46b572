"""Every node on a bus, for a change that must leave nobody out: who is there and takes part in LSS, what else is heard.

Changes nothing.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

from dvtcli.device.lss_master import LssMaster
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.lss_services import ANSWER_ID, PARTS, LssAddress
from dvtcli.domain.nmt import UNCONFIGURED, NmtState
from dvtcli.domain.several import join_some
from dvtcli.errors import DvtcliError, SafetyRefusal
from dvtcli.operations.lss.lss_find import lss_bus, scanned, selected, two_alike
from dvtcli.operations.lss.lss_identity import Identity, who_is_there
from dvtcli.operations.lss.lss_node_id import heard_ids, told_id
from dvtcli.operations.results.lss_nodes import LssGiven

if TYPE_CHECKING:
    from dvtcli.domain.ports import CanopenBus, Frame
    from dvtcli.operations.session.session import Session

#: what a node says by itself and in answer, whatever its PDOs: EMCY, SDO, heartbeat (CiA 301, 7.3.5)
_OWN = (0x080, 0x580, 0x700)


def all_on_bus(session: Session, master: LssMaster, file: str | None = None) -> list[LssGiven]:
    """Every node that is on the bus, those without a node-ID, too; with *file* exactly the nodes of that network.

    SafetyRefusal where another one is heard, one of the file is not, one does not tell its whole address, or one says
    that it is OPERATIONAL. Who does not say its NMT state is named in a warning.
    """
    bus = lss_bus(session)
    frames: dict[int, Frame] = {}

    def note(frame: Frame, sent: bool) -> None:
        if not sent:
            frames.setdefault(frame.can_id, frame)

    stop = bus.tap(note)
    try:
        there = who_is_there(bus, heard_ids(session))
    finally:
        stop()
    if file is not None:
        _refuse_others(file, there)
    _refuse_running(session, bus, there)
    _refuse_strangers(frames, there)
    nodes = [LssGiven(_address(node_id, identity), node_id, node_id) for node_id, identity in there.items()]
    waiting = scanned(session, master)
    if waiting and file is not None:
        raise SafetyRefusal(
            f"nodes without a node-ID are on the bus, of which {file} says nothing", hint=Hint(Action.LSS_SCAN)
        )
    for node in waiting:
        if not node.confirmed:
            raise two_alike(node.address)
    return [*nodes, *(LssGiven(lss_node.address, UNCONFIGURED, UNCONFIGURED) for lss_node in waiting)]


def _refuse_others(file: str, there: Collection[int]) -> None:
    from dvtcli.operations.wanted.network_wish import read_wish

    wanted = {wish.node_id: wish.name for wish in read_wish(file).nodes}
    if others := [f"node {node_id}" for node_id in there if node_id not in wanted]:
        raise SafetyRefusal(f"{join_some(others)} on the bus, and not in {file}", hint="take it off, or into the file")
    if missing := [f"{name} ({node_id})" for node_id, name in wanted.items() if node_id not in there]:
        raise SafetyRefusal(
            f"not on the bus, but in {file}: {join_some(missing)}",
            hint=Hint(Action.FIND_NODES, why="shows who is there"),
        )


def _refuse_running(session: Session, bus: CanopenBus, there: Collection[int]) -> None:
    states = {node_id: bus.nmt_state(node_id) for node_id in there}
    running = [f"node {node_id}" for node_id, state in states.items() if state is NmtState.OPERATIONAL]
    unknown = [f"node {node_id}" for node_id, state in states.items() if state is None]
    if unknown:
        session.tell.warning(
            f"{join_some(unknown)}: no heartbeat says whether it is OPERATIONAL; the machine must stand still"
        )
    if running:
        raise SafetyRefusal(
            f"OPERATIONAL: {join_some(running)}",
            hint=Hint(Action.ENTER_PRE_OPERATIONAL, {"node": "all"}, "{}, once the machine stands still"),
        )


def _refuse_strangers(frames: dict[int, Frame], there: Collection[int]) -> None:
    """Refuse frames that no node of *there* sends by itself while it is PRE-OPERATIONAL."""
    theirs = {base + node_id for base in _OWN for node_id in there} | {ANSWER_ID}
    strange = next((frame for frame in frames.values() if frame.extended or frame.can_id not in theirs), None)
    if strange is not None:
        raise SafetyRefusal(
            f"0x{strange.can_id:03X} is heard, which none of the nodes that answer sends before it is OPERATIONAL",
            why="whoever sends it would stay at the old bit rate, or be a producer of SYNC or PDOs",
            hint=Hint(
                Action.ENTER_PRE_OPERATIONAL,
                {"node": "all"},
                "ends PDOs; 1006 = 0 ends SYNC; take off the bus who knows no CANopen",
            ),
        )


def _address(node_id: int, identity: Identity | None) -> LssAddress:
    told = [part for part in identity or () if part is not None]
    if len(told) != PARTS:
        raise SafetyRefusal(
            f"node {node_id} does not tell its whole LSS address (0x1018:1..4): it would stay as it is", node=node_id,
            hint="take it off the bus, and set its bit rate in its maker's way",
        )  # fmt: skip
    return LssAddress(*told)


def confirmed(master: LssMaster, nodes: Sequence[LssGiven]) -> list[LssGiven]:
    """*nodes*, once each has said by LSS that it has its node-ID; SafetyRefusal where one takes no part in LSS."""
    for node in nodes:
        try:
            now = selected(master, node.address)
        except DvtcliError as failed:
            raise SafetyRefusal(
                f"node {told_id(node.node_id)} takes no part in LSS: it would stay as it is", why=failed.text,
                hint="take it off the bus, and set its bit rate in its maker's way",
            ) from failed  # fmt: skip
        if now != node.node_id:
            raise SafetyRefusal(f"{node.address} has node-ID {told_id(now)} by LSS, and {told_id(node.node_id)} by SDO")
    master.let_wait()
    return list(nodes)
