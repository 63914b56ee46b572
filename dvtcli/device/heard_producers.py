"""Frames on the bus with the CAN-ID that a TPDO is to get, if no known node sends them. Reads COB-IDs."""

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
    from dvtcli.device.known_pdos import KnownPdos
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.domain.ports import CanopenBus, Frame
    from dvtcli.domain.rules import Finding


#: how long is listened for a CAN-ID in all, the time in which the node is read included (s), and at once
LISTENED_S, AT_ONCE_S = 0.1, 0.01


@dataclass(slots=True)
class HeardIds:
    """How many frames of each CAN-ID (with whether it has 29 bits) others sent, and which were sent from here.

    *bus* is listened to since *since_s* (s, of its time), when *states* were known of its nodes; None if it is not.
    """

    bus: CanopenBus | None = None
    since_s: float = 0.0
    states: Mapping[int, NmtState] = field(default_factory=dict)
    others: dict[tuple[int, bool], int] = field(default_factory=dict)
    sent: set[tuple[int, bool]] = field(default_factory=set)

    def note(self, frame: Frame, sent: bool) -> None:
        """*frame* passed; a remote frame asks for what its CAN-ID's producer sends."""
        identifier = (frame.can_id, frame.extended)
        if sent:
            self.sent.add(identifier)
        elif not frame.remote:
            self.others[identifier] = self.others.get(identifier, 0) + 1

    def may_hear(self, identifier: tuple[int, bool]) -> bool:
        """Whether *identifier* was heard, or is yet to be listened for."""
        return self.bus is not None and (identifier in self.others or self.bus.now_s() - self.since_s < LISTENED_S)

    def frames_of(self, identifier: tuple[int, bool]) -> int:
        """How many frames of *identifier* others sent; if none yet, what is left of LISTENED_S is listened for one."""
        while self.bus is not None and identifier not in self.others and self.bus.now_s() - self.since_s < LISTENED_S:
            self.bus.idle(AT_ONCE_S)
        return self.others.get(identifier, 0)

    def cannot_send(self, node_id: int) -> bool:
        """Whether node *node_id* sent no PDO since then: it said before and after that it is not OPERATIONAL."""
        silent = (NmtState.PRE_OPERATIONAL, NmtState.STOPPED)
        return self.bus is not None and {self.states.get(node_id), self.bus.nmt_state(node_id)} <= {*silent}


@contextmanager
def heard_ids(bus: CanopenBus) -> Iterator[HeardIds]:
    """What passes on *bus* while the block runs; nothing on a simulated bus, where every node is known."""
    if bus.simulated or not bus.carries_frames:
        yield HeardIds()
        return
    states = bus.heard_nodes()  # takes what waits since before: a TPDO that was switched off by then sent it
    found = HeardIds(bus, bus.now_s(), states)
    end = bus.tap(found.note)
    try:
        yield found
    finally:
        end()


def heard_producer_findings(
    node: KnownPdos, changes: Mapping[Pdo, tuple[PdoConfig, PdoConfig]], heard: HeardIds
) -> Iterator[Finding]:
    """An error for each TPDO of *changes* (before, after) that gets a CAN-ID which somebody unknown sends.

    Frames of TPDOs that another known node has enabled now do not count, nor those of *node* unless it cannot have sent
    them: the other rules judge these.
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
