"""What is required before something is done: a yes, or the identity or power state that a script asks for."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import read_identity
from dvtcli.device.seen_state import CONTROLWORDS, STATUSWORDS, why_it_may_move
from dvtcli.domain.can_ids import LSS_REQUEST_ID, NMT_ID
from dvtcli.domain.cob_id import can_id_text
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.concise_dcf import concise_entries
from dvtcli.domain.process_data import drive_state
from dvtcli.domain.rules.finding import WARNING, Rule, warning
from dvtcli.domain.text import join_some, plural
from dvtcli.errors import InputFileError, SafetyRefusal, SdoAborted

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dvtcli.device.node_parts import NodeDescription
    from dvtcli.domain.ports import Frame
    from dvtcli.domain.rules.finding import Finding
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser


def consent_to_concise(session: SessionUser, node: NodeDescription, sub_index: int, data: bytes) -> None:
    """Ask before *data* becomes the manager *node*'s download to the node *sub_index*.

    Raises InputFileError as `concise_doubt`.
    """
    doubt = concise_doubt(node, sub_index, data, force=session.options.force)
    session.consent(f"{doubt}; write it?", node.node_id)


def concise_doubt(node: NodeDescription, sub_index: int, data: bytes, *, force: bool) -> str:
    """Warn about *data* as the manager *node*'s download to the node *sub_index*.

    Raises InputFileError if *data* is not a valid concise DCF, unless forced: the node would get a part of it.
    """
    try:
        count = plural(len(concise_entries(data)), "value")
    except ValueError as wrong:
        if not force:
            place = f"1F22:{sub_index:02X}"
            raise InputFileError(
                f"node {node.node_id} 0x{place}: not a concise DCF",
                node=node.node_id,
                place=place,
                why=str(wrong),
                hint=Hint(Action.CONVERT, {"file": "net.yaml", "target": "node5.cdcf"}, "makes a concise DCF")
                + Hint(Action.FORCE, why="writes it anyway"),
            ) from wrong
        count = f"{len(data)} bytes that are not a concise DCF"
    return f"node {node.node_id} ({node.title}) is to download {count} to node {sub_index} whenever that boots"


def concise_doubts(node: NodeDescription, downloads: Mapping[int, bytes], *, force: bool) -> str:
    """Warn about *downloads*, by node-ID, in a single question; empty if there is no doubt."""
    doubts = [concise_doubt(node, node_id, data, force=force) for node_id, data in downloads.items()]
    if len(doubts) < 2:
        return "".join(doubts)
    ids = join_some(map(str, downloads))
    return f"node {node.node_id} ({node.title}) is to download other values to nodes {ids} whenever they boot"


#: How long the bus is listened to before several nodes are written to, in seconds.
LISTEN_S = 2.0
_SDO_REQUESTS = range(0x601, 0x680)


def refuse_other_master(session: SessionNodes) -> None:
    """Record the bus for `LISTEN_S`; raises SafetyRefusal for a foreign request, unless forced.

    Skipped if nobody else can be there: nodes of this process, twins, an interface without frames.
    """
    bus = session.bus
    if session.dry_run or session.options.force or bus.simulated or not bus.carries_frames:
        return
    session.reporter.progress(f"listening for another master, {LISTEN_S:g} s", 0, 0)
    for frame in bus.receive(LISTEN_S):
        said = _request(frame)
        if said:
            can_id = can_id_text(frame.can_id, extended=frame.extended)
            raise SafetyRefusal(
                f"another master is active: {said} was received",
                why=f"{can_id} [{len(frame.data)}] {frame.data.hex(' ').upper()}",
                hint=Hint(Action.FORCE, why="stop it while the network is changed; {} continues in parallel"),
            )


def _request(frame: Frame) -> str:
    """Describe *frame* as a master's request; empty if it is none."""
    if frame.extended or frame.remote:
        return ""
    if frame.can_id == NMT_ID:
        return "an NMT command"
    if frame.can_id == LSS_REQUEST_ID:
        return "an LSS command"
    return f"an SDO request to node {frame.can_id - 0x600}" if frame.can_id in _SDO_REQUESTS else ""


#: states of CiA 402-2, 8.4.2 with a supplied power stage
_ON = frozenset({"switched on", "operation enabled", "quick stop active", "fault reaction active"})
RULES = (
    Rule("power-stage-on", WARNING, "a file is to be written to a drive whose power stage is on: `apply` refuses",
         "the statusword of each axis; CiA 402-2, 8.4.2"),
)  # fmt: skip
#: a controlword is right before its statusword (CiA 402-2), for further axes as well
_CONTROLWORD = -1


def refuse_powered(session: SessionNodes, node_ids: Iterable[int]) -> None:
    """Raises SafetyRefusal if a statusword (0x6041, 0x6841, …) of *node_ids* shows an enabled power stage."""
    for node_id in node_ids:
        for index, _, state in _powered(session, node_id):
            off = Hint(
                Action.WRITE, {"object": f"{index + _CONTROLWORD:04X}", "value": 0},
                "bring the machine to a standstill, then {}; a file is written to a drive that cannot move",
            )  # fmt: skip
            raise SafetyRefusal(f"the power stage of node {node_id} is {state}", node=node_id, hint=off)


def powered_findings(session: SessionNodes, node_id: int) -> tuple[Finding, ...]:
    """Report, when planning, each axis whose power stage would make `refuse_powered` refuse."""
    return tuple(
        warning("power-stage-on", place, f"the power stage is {state}: apply refuses to write until it is off")
        for _, place, state in _powered(session, node_id)
    )


def _powered(session: SessionNodes, node_id: int) -> Iterator[tuple[int, str, str]]:
    """Yield statuswords with an enabled power stage: index, place, meaning."""
    for index, sub_index in STATUSWORDS:
        try:
            data = session.bus.sdo(node_id).upload(index, sub_index)
        except SdoAborted:
            continue  # no axis, or one that does not tell
        statusword = int.from_bytes(data, "little")
        state = drive_state(statusword)
        if state in _ON:
            yield index, f"0x{index:04X}:{sub_index:02X}", f"on: {state} (0x{index:04X} is 0x{statusword:04X})"


def consent_to_reset(session: SessionNodes, node_ids: Collection[int]) -> None:
    """Ask before a reset of *node_ids* if a node may be an enabled drive; raises SafetyRefusal on no.

    A simulated drive boots as in its EDS, perhaps enabled: it counts only after a command of this session.
    """
    if session.options.yes or session.dry_run:
        return
    for node_id, why in _may_move(session, node_ids).items():
        session.consent(f"node {node_id} {why}: its reset lets a motor go; reset?", node_id)


def refuse_reset(session: SessionNodes, node_ids: Collection[int]) -> None:
    """Raises SafetyRefusal if one of *node_ids* may be an enabled drive, even under --yes."""
    for node_id, why in _may_move(session, node_ids).items():
        raise SafetyRefusal(
            f"node {node_id} {why}: its reset lets a motor go",
            node=node_id,
            hint=Hint(
                Action.GIVE,
                {"prove": True},
                "bring the machine to a standstill, then 6040 = 6; without {} no node is reset",
            ),
        )


def _may_move(session: SessionNodes, node_ids: Collection[int]) -> dict[int, str]:
    """Map those of *node_ids* that may be enabled drives to the reason."""
    if session.bus.simulated:
        node_ids = [node_id for node_id in node_ids if commanded(session, node_id)]
    said = {node_id: why_it_may_move(session.bus, node_id) for node_id in sorted(node_ids)}
    return {node_id: why for node_id, why in said.items() if why}


def consent_to_reset_silent(session: SessionNodes) -> None:
    """Ask before a reset of all nodes if none is known: whether a drive moves is unknown."""
    if not session.bus.simulated:
        session.consent("no node is seen on the bus, but there may be a drive with operation enabled; reset all?")


def commanded(session: SessionNodes, node_id: int) -> bool:
    """Tell whether this session wrote a controlword of the node."""
    node = session.network.nodes.get(node_id)
    return node is not None and not CONTROLWORDS.isdisjoint(node.wanted_values)


#: sub-indices of 0x1018, the identity object
_SUB_INDICES = {"vendor": 1, "product": 2, "revision": 3, "serial": 4}


def require_identity(
    session: SessionNodes, wanted: Sequence[tuple[str, int]], node_id: int | None = None, who: str = "the script"
) -> Facts:
    """Compare the identity (0x1018) of a node (None: the selected node) with *wanted*.

    *wanted* has pairs of `vendor`, `product`, `revision` or `serial` and a number. Raises SafetyRefusal, naming *who*
    wants another device, if a number differs.
    """
    from dvtcli.operations.results import Facts

    node = session.node(node_id)
    held = {name: read_identity(node.sdo, sub_index) for name, sub_index in _SUB_INDICES.items()}
    for name, value in wanted:
        if held[name] != value:
            has = "none" if held[name] is None else f"0x{held[name]:08X}"
            raise SafetyRefusal(
                f"node {node.node_id} is another device: {name} is {has}, {who} wants 0x{value:08X}",
                node=node.node_id,
                place=f"1018:{_SUB_INDICES[name]:02X}",
                hint=Hint(Action.FIND_NODES, why="is this the right node? {} lists them"),
            )
    shown = ", ".join(f"{name} 0x{value:08X}" for name, value in wanted)
    return Facts(
        "require",
        (("node", node.node_id), ("identity", held)),
        (f"node {node.node_id} is the required device: {shown}",),
    )


def require_power_off(session: SessionNodes, node_id: int | None = None) -> Facts:
    """Raises SafetyRefusal if a statusword of a node (None: the selected node) shows an enabled power stage."""
    from dvtcli.operations.results import Facts

    node = session.node(node_id)
    refuse_powered(session, [node.node_id])
    rows = (("node", node.node_id), ("power_off", True))
    return Facts("require", rows, (f"no statusword of node {node.node_id} says that its power stage is on",))
