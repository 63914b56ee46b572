"""Frames on the bus with the CAN-ID that a TPDO is to get, if no known node sends them. Reads COB-IDs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.device.neighbours import producers
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.rules.finding import error

if TYPE_CHECKING:
    from dvtcli.device.known_pdos import KnownPdos
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.domain.ports import CanopenBus, Frame
    from dvtcli.domain.rules import Finding


@dataclass(slots=True)
class HeardIds:
    """How many frames of each CAN-ID (with whether it has 29 bits) others sent, and which were sent from here."""

    others: dict[tuple[int, bool], int] = field(default_factory=dict)
    sent: set[tuple[int, bool]] = field(default_factory=set)

    def note(self, frame: Frame, sent: bool) -> None:
        """*frame* passed; a remote frame asks for what its CAN-ID's producer sends."""
        identifier = (frame.can_id, frame.extended)
        if sent:
            self.sent.add(identifier)
        elif not frame.remote:
            self.others[identifier] = self.others.get(identifier, 0) + 1


@contextmanager
def heard_ids(bus: CanopenBus) -> Iterator[HeardIds]:
    """What passes on *bus* while the block runs; nothing on a simulated bus, where every node is known."""
    found = HeardIds()
    if bus.simulated or not bus.carries_frames:
        yield found
        return
    bus.heard_nodes()  # takes what waits since before: a TPDO that was switched off by then sent it
    end = bus.tap(found.note)
    try:
        yield found
    finally:
        end()


def heard_producer_findings(
    node: KnownPdos, changes: Mapping[Pdo, tuple[PdoConfig, PdoConfig]], heard: HeardIds
) -> Iterator[Finding]:
    """An error for each TPDO of *changes* (before, after) that gets a CAN-ID which somebody unknown sends.

    Frames of TPDOs that *node*, or another known node, has enabled now do not count: the other rules judge these.
    """
    for pdo, (now, want) in changes.items():
        held, cob_id = now.communication.cob_id, want.communication.cob_id
        identifier = (cob_id.can_id, cob_id.extended)
        frames = heard.others.get(identifier, 0)
        is_own = held.valid and (held.can_id, held.extended) == identifier
        if not pdo.is_tpdo or not cob_id.valid or is_own or not frames or identifier in heard.sent:
            continue
        own = [held for other, held in node.known_cob_ids().items() if other.is_tpdo and held.valid]
        known = [*own, *(producer.cob_id for producer in producers(node.neighbours()))]
        if identifier not in {(known_id.can_id, known_id.extended) for known_id in known}:
            heard_words = f"{frames} frame{'s' if frames > 1 else ''} while the node was read"
            text = f"CAN-ID {cob_id} is on the bus already, sent by a node that is not known here ({heard_words})"
            hint = Hint(Action.CHECK_LIVE, why="asks every node") + Hint(
                Action.SELECT_CAN_ID, why="switch that TPDO off, take another CAN-ID, or {}"
            )
            yield error("one-producer", f"0x{pdo.communication_index:04X}:01", text, hint=hint)
