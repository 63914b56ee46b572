"""Which frames are known: the mappings of nodes as they hold them now, read once, and those of a file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import BusUnavailable, NoAnswer, SdoAborted, SdoProtocolError, UsageError
from dvtcli.operations.meanings.physical_meanings import meanings_of
from dvtcli.watch.decoder import Decoder, pdo_layouts

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.ports import CanopenBus
    from dvtcli.operations.session.session import Session

#: how long is waited for a first heartbeat where no node is named (s): most are sent once a second or faster
HEARD_S = 1.2
_WITHOUT_EDS = Hint(Action.GIVE_EDS, why="its values have no names, and no sign: -1 reads 65535; {}") + Hint(
    Action.ADD_EDS, why=", or {}, gives them"
)


def open_wire(session: Session) -> CanopenBus:
    """The bus itself, also under --dry-run: only to listen to. UsageError where it carries no frames."""
    bus = session.open_network().bus
    if not bus.carries_frames:
        raise UsageError(
            f"{bus.name} carries no CAN frames: there is nothing to listen to",
            hint="objects can be read and written there; an interface of this machine hears frames",
        )
    return bus


def live_decoder(session: Session, nodes: tuple[int, ...], dbc: str | None = None) -> Decoder:
    """The decoder for *nodes*, else for the selected, the simulated and the heard ones, after that of the DBC file.

    A node that does not answer is said, and its frames stay bytes. Only reads: SDO uploads.
    """
    decoder = Decoder()
    for _, decoder in live_decoders(session, nodes, dbc):  # noqa: B007 - the last one knows all
        pass
    return decoder


def live_decoders(
    session: Session, nodes: tuple[int, ...], dbc: str | None = None, *, named: bool = False
) -> Iterator[tuple[int | None, Decoder]]:
    """The same node by node: the node that is read next (None: all are), and the decoder for those before it.

    With *named* it also has the nodes' names: one read more of each that has no EDS.
    """
    known, names = Decoder(), dict[int, str]()
    if dbc is not None:
        from dvtcli.operations.frames.file_layouts import file_layouts

        known.add(file_layouts(dbc, session.tell))
    for node_id in () if dbc is not None and not nodes else nodes or _present(session):
        yield node_id, Decoder(known.layouts, names)
        try:
            node = session.node(node_id)
            meanings = meanings_of(node.profile, node.dictionary)
            known.add(pdo_layouts(node_id, node.pdos(), node.dictionary, meanings, mapping_of(session, node_id)))
            if named:
                names[node_id] = _name(node)
            if node.dictionary is None:
                session.tell.note(f"node {node_id} has no EDS: {_WITHOUT_EDS}")
        except BusUnavailable:
            raise
        except (NoAnswer, SdoAborted, SdoProtocolError) as silent:
            session.tell.note(f"node {node_id}: its mapping cannot be read ({silent.text}); its frames stay bytes")
    yield None, Decoder(known.layouts, names)


def mapping_of(session: Session, node_id: int) -> str:
    """Whose mapping is meant, in words: a simulated node is not the one that sent what a recording holds."""
    simulated = node_id in session.network.simulated_ids
    return f"the mapping of the simulated node {node_id}" if simulated else f"the mapping that node {node_id} holds now"


def _name(node: Node) -> str:
    """What *node* is called: by its EDS, by itself (0x1008), by its family."""
    from dvtcli.operations.nodes.identify import device_name

    named = node.dictionary.info.product_name if node.dictionary is not None else device_name(node.sdo)
    return named or node.profile.title


def _present(session: Session) -> list[int]:
    """The nodes that are known without asking: the selected one, simulated ones, and those whose heartbeat is heard."""
    network = session.network
    found = {session.selected_id(), *network.simulated_ids, *network.nodes}
    if found == {None}:
        bus = session.wire
        bus.sleep(HEARD_S)
        found |= set(bus.heard_nodes())
    return sorted(node_id for node_id in found if node_id is not None)
