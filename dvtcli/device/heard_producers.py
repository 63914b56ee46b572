"""Frames on the bus with the new CAN-ID of a TPDO, sent by no known node. Reads COB-IDs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.device.neighbours import producers
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.rules.finding import error

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.domain.ports import CanopenBus, Frame
    from dvtcli.domain.rules import Finding


#: how long is listened for a CAN-ID in all, the time in which the node is read included (s), and at once
LISTENED_S, AT_ONCE_S = 0.1, 0.01


@dataclass(slots=True)
class HeardIds:
    """Counts of received frames per CAN-ID (with true for 29 bits), and the CAN-IDs sent from here.

    *bus* is monitored since *since_s* (s, in its time) with the *states* of its nodes at that time; None if not
    monitored.
    """

    bus: CanopenBus | None = None
    since_s: float = 0.0
    states: Mapping[int, NmtState] = field(default_factory=dict)
    others: dict[tuple[int, bool], int] = field(default_factory=dict)
    sent: set[tuple[int, bool]] = field(default_factory=set)

    def note(self, frame: Frame, sent: bool) -> None:
        """Count *frame*; a remote frame comes from a consumer and does not count."""
        identifier = (frame.can_id, frame.extended)
        if sent:
            self.sent.add(identifier)
        elif not frame.remote:
            self.others[identifier] = self.others.get(identifier, 0) + 1

    def may_hear(self, identifier: tuple[int, bool]) -> bool:
        """True if *identifier* was received, or may still be received within LISTENED_S."""
        return self.bus is not None and (identifier in self.others or self.bus.now_s() - self.since_s < LISTENED_S)

    def frames_of(self, identifier: tuple[int, bool]) -> int:
        """The number of frames received with *identifier*; waits for the rest of LISTENED_S if none yet."""
        while self.bus is not None and identifier not in self.others and self.bus.now_s() - self.since_s < LISTENED_S:
            self.bus.idle(AT_ONCE_S)
        return self.others.get(identifier, 0)

    def cannot_send(self, node_id: int) -> bool:
        """True if node *node_id* sent no PDO meanwhile: it reported another state than OPERATIONAL before and after."""
        silent = (NmtState.PRE_OPERATIONAL, NmtState.STOPPED)
        return self.bus is not None and {self.states.get(node_id), self.bus.nmt_state(node_id)} <= {*silent}


@contextmanager
def heard_ids(bus: CanopenBus) -> Iterator[HeardIds]:
    """The frames on *bus* during the block; empty on a simulated bus with only known nodes."""
    if bus.simulated or not bus.carries_frames:
        yield HeardIds()
        return
    states = bus.heard_nodes()  # drains older frames, sent by a TPDO disabled meanwhile
    found = HeardIds(bus, bus.now_s(), states)
    end = bus.tap(found.note)
    try:
        yield found
    finally:
        end()


def heard_producer_findings(
    node: ReadableNode, changes: Mapping[Pdo, tuple[PdoConfig, PdoConfig]], heard: HeardIds
) -> Iterator[Finding]:
    """An error for each TPDO of *changes* (before, after) with a new CAN-ID already sent by an unknown producer.

    Frames of enabled TPDOs of other known nodes do not count, nor frames of *node* unless impossible: other rules check
    these.
    """
    for pdo, (now, want) in changes.items():
        held, cob_id = now.communication.cob_id, want.communication.cob_id
        identifier = (cob_id.can_id, cob_id.extended)
        if not pdo.is_tpdo or not cob_id.valid or identifier in heard.sent:
            continue
        is_own = held.valid and (held.can_id, held.extended) == identifier
        if not (identifier in heard.others if is_own else heard.may_hear(identifier)):
            continue
        cannot_send = heard.cannot_send(node.node_id)
        if is_own and not cannot_send:
            continue
        own = [] if cannot_send else [at for other, at in node.known_cob_ids().items() if other.is_tpdo and at.valid]
        known = [*own, *(producer.cob_id for producer in producers(node.neighbours()))]
        if identifier in {(known_id.can_id, known_id.extended) for known_id in known}:
            continue
        if frames := heard.frames_of(identifier):
            heard_words = f"{frames} frame{'s' if frames > 1 else ''} heard"
            text = f"CAN-ID {cob_id} is on the bus already, sent by a node that is not known here ({heard_words})"
            hint = Hint(Action.CHECK_LIVE, why="asks every node") + Hint(
                Action.SELECT_CAN_ID, why="switch that TPDO off, take another CAN-ID, or {}"
            )
            yield error("one-producer", f"0x{pdo.communication_index:04X}:01", text, hint=hint)
