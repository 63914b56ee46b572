"""Another bit rate for a bus and every node on it, by LSS: under consent, all are seen at the new one, or brought back.

Does not know who is on the bus (`lss_on_bus`), nor how all change together (`lss_rate_change`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from dvtcli.device.lss_master import LssMaster
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.lss_services import BIT_TIMINGS
from dvtcli.domain.several import join_some, plural
from dvtcli.errors import NoAnswer, SafetyRefusal, UsageError
from dvtcli.operations.lss.lss_find import lss_bus
from dvtcli.operations.lss.lss_node_id import told_id
from dvtcli.operations.lss.lss_on_bus import all_on_bus, confirmed
from dvtcli.operations.lss.lss_rate_change import RateChange, names
from dvtcli.operations.lss.lss_rate_proof import prove_by_resets, refuse_resets
from dvtcli.operations.results.lss_nodes import LssBitRate, LssGiven

if TYPE_CHECKING:
    from dvtcli.domain.ports import CanopenBus
    from dvtcli.operations.session.session import Session


def lss_bit_rate(
    session: Session, bit_rate: int, file: str | None = None, *, stores: bool = False, prove: bool = False
) -> LssBitRate:
    """Let the bus and every node on it run at *bit_rate* (bit/s, one of the standard's).

    Asks first. The nodes of the network *file*, None: all that are found; SafetyRefusal where anybody else is heard,
    one does not take part in LSS or is OPERATIONAL, or the bit rate of the interface cannot be set from here. Done once
    each node says at the new bit rate who it is; where one does not all go back. With *stores* each stores it then,
    also where the bus runs at it already; without, no node is asked then. With *prove* all are reset then at once, and
    looked at; refused where a drive may move. DeviceRefused, NoAnswer with state `rolled_back`; LeftChanged. A dry run
    looks at the interface and the file, and sends nothing.
    """
    if bit_rate not in BIT_TIMINGS:
        known = join_some([str(rate) for rate in BIT_TIMINGS])
        raise UsageError(f"LSS knows no bit rate {bit_rate}", hint=f"the standard's are {known}")
    bus = lss_bus(session)
    before = _way_back(bus, bit_rate)
    if session.dry_run:
        _require_readable(file)
        return LssBitRate(bit_rate, dry_run=True)
    if before == bit_rate and not stores:
        return LssBitRate(bit_rate, before)
    with LssMaster(bus) as master:
        nodes = confirmed(master, all_on_bus(session, master, file))
        if not nodes:
            raise NoAnswer(
                "no node is on the bus that could be told",
                hint=Hint(Action.LISTEN_BIT_RATE, why="listens for the bit rate in use"),
            )
        if prove:
            refuse_resets(session, nodes)
        _agree(session, nodes, before, bit_rate, stores=stores, prove=prove)
        with session.cancellation.guard():
            change = RateChange(session, master, nodes, before, bit_rate)
            if before != bit_rate:
                change.make()
            nodes = change.store() if stores else nodes
            nodes = prove_by_resets(session, change, nodes) if prove else nodes
    return LssBitRate(bit_rate, before, tuple(nodes))


def _way_back(bus: CanopenBus, bit_rate: int) -> int:
    """What the bus runs at (bit/s), to which it could be set back; SafetyRefusal where that is not so."""
    bus.require_settable(bit_rate)
    before = bus.runs_at
    if before is None:
        raise SafetyRefusal(
            f"the bit rate of {bus.name} is not known, so that there is no way back to it",
            hint=Hint(Action.GIVE_BIT_RATE, why="says it") + Hint(Action.LISTEN_BIT_RATE, why="listens for it"),
        )
    if before not in BIT_TIMINGS:
        raise SafetyRefusal(f"{bus.name} runs at {before} bit/s, to which LSS knows no way back")
    return before


def _require_readable(file: str | None) -> None:
    """InputFileError where the network *file* cannot be used."""
    if file is not None:
        from dvtcli.operations.wanted.network_wish import read_wish

        read_wish(file)


def _agree(
    session: Session, nodes: Sequence[LssGiven], before: int, bit_rate: int, *, stores: bool, prove: bool
) -> None:
    """Tell who is told, and ask."""
    then = ", and reset all of them" if prove else ""
    if before == bit_rate:
        who = f"{plural(len(nodes), 'node')}: {names(nodes)}"
        session.consent(f"store {bit_rate} bit/s, at which this bus runs already, in {who}{then}?")
        return
    for node in nodes:
        session.tell.note(f"plan: node-ID {told_id(node.node_id)}, {node.address}: {before} -> {bit_rate} bit/s")
    session.consent(
        f"change the bit rate of this bus and of {plural(len(nodes), 'node')} from {before} to {bit_rate} bit/s"
        f"{', and store it' if stores else ''}{then}? Nothing else may be on it"
    )
