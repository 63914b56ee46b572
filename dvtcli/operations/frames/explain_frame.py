"""Explain every bit of a frame, and find its producers and consumers by nodes and a network file. Does not send it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import read_number
from dvtcli.domain.cob_id import SRDO_COB_IDS, SRDO_DIRECTION, CobId
from dvtcli.domain.objects import COB_ID_EMCY, COB_ID_TIME, SDO_CLIENTS, SDO_SERVERS, SRDO_COMMUNICATION
from dvtcli.domain.ports import Frame
from dvtcli.domain.typed_frame import typed_frame
from dvtcli.errors import BusUnavailable, NoAnswer, SdoAborted, SdoProtocolError, UsageError
from dvtcli.operations.frames.layouts import HEARD_S, file_layouts, mapping_of
from dvtcli.operations.frames.recorded import decoder_for
from dvtcli.operations.network.described_nodes import NETWORK_SUFFIXES, described_nodes, network_config_of
from dvtcli.operations.pdos.sync import sync_frame
from dvtcli.operations.results.frames import FrameExplained, FrameSeen
from dvtcli.operations.values.object_values import scalings_of
from dvtcli.watch.decoder import Decoder, Layout, doubts, misfit, no_values, pdo_layouts, server_name, srdo_name
from dvtcli.watch.frame_effect import Parties
from dvtcli.watch.frame_parts import frame_parts
from dvtcli.watch.frame_reader import FrameReader, Reading
from dvtcli.watch.service import Service

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.watch.decoder import Address

HOW = "write it as 185#1027, as candump does, or as 0x185 10 27"


def parsed_frame(text: str) -> Frame:
    """Parse a frame; raises UsageError if invalid."""
    try:
        return typed_frame(text)
    except ValueError as wrong:
        raise UsageError(str(wrong), hint=HOW) from wrong


def explain_frame(
    session: SessionNodes, text: str, nodes: tuple[int, ...] | None = None, file: str | None = None
) -> FrameExplained:
    """Explain every bit of the frame in *text* by the mappings of *nodes*, or by *file*.

    *file* is a DBC or network file. The frame is not sent; of nodes only mappings are read. Raises UsageError if *text*
    is not a frame.
    """
    frame = parsed_frame(text)
    config = network_config_of(file)
    decoder = decoder_for(session, nodes, file, config=config)
    for doubt in doubts(frame, decoder.layout(frame)):
        session.reporter.warning(doubt)
    return explained(frame, FrameReader(decoder, described_nodes(session, file, config)))


def explained(frame: Frame, reader: FrameReader) -> FrameExplained:
    """Explain every bit of *frame*, the next frame for *reader*."""
    service = reader.decoder.layout(frame).service
    parts = tuple(frame_parts(frame, reader.decoder, reader.described))
    return FrameExplained(frame, service.kind, service.label, service.node, parts, reader.read(frame))


def frame_seen(frame: Frame, decoder: Decoder, reading: Reading | None = None) -> FrameSeen:
    """Decode *frame*, with what it says in words; its PDO is named only if a mapping was read."""
    layout = decoder.layout(frame)
    service = layout.service
    fits = layout.byte_length in (None, len(frame.data)) or not misfit(frame, layout)
    mapped = None if fits else layout.byte_length
    return FrameSeen(
        frame, service.kind, service.label, service.node, layout.pdo, layout.values(frame), layout.scalings,
        objects=layout.objects, mapped_bytes=mapped, layout_from=layout.source, layout_is_guess=bool(layout.guess),
        reading=reading or Reading(service.kind),
    )  # fmt: skip


#: bits of 0x1012: the node consumes TIME, it produces TIME (CiA 301, 7.5.2.15); bit 31 is no "off" here
_TAKES, _SENDS = 1 << 31, 1 << 30
_SDO_WORDS = {1: "request", 2: "answer"}
_SERVER = 3


def node_services(node: ReadableNode) -> Iterator[tuple[Address, Service]]:
    """Yield each service of *node* by CAN-ID: SYNC, TIME, EMCY, SDO servers (0x1200…), SDO clients (0x1280…), SRDOs.

    Unreadable objects are left out.
    """
    sync = sync_frame(node.sdo)
    yield (sync.can_id, sync.extended), Service("sync", "SYNC")
    time = _number(node, COB_ID_TIME, 0)
    if time is not None and time & (_TAKES | _SENDS) and (address := _address(time & ~_TAKES)):
        yield address, Service("time", "TIME")
    if address := _address(_number(node, COB_ID_EMCY, 0)):
        yield address, Service("emcy", "EMCY", node.node_id)
    for index, channel in _sdo_channels(node, SDO_SERVERS):
        for word, address in channel.items():
            yield address, Service("sdo", f"{server_name(index)} {word}", node.node_id)
    for index, channel in _sdo_channels(node, SDO_CLIENTS):
        server = (_number(node, index, _SERVER, 1) or None) if channel else None
        for word, address in channel.items():
            yield address, Service("sdo", f"SDO {word}", server)
    yield from _srdos(node)


def _srdos(node: ReadableNode) -> Iterator[tuple[Address, Service]]:
    """Yield both CAN-IDs of each SRDO in the EDS that is in use (EN 50325-5)."""
    for index in node.dictionary.indices_among(SRDO_COMMUNICATION) if node.dictionary else ():
        if _number(node, index, SRDO_DIRECTION, 1):
            for sub_index in SRDO_COB_IDS:
                if address := _address(_number(node, index, sub_index)):
                    yield address, Service("other", srdo_name(index, sub_index), node.node_id)


def _sdo_channels(node: ReadableNode, indices: range) -> Iterator[tuple[int, dict[str, Address]]]:
    """Yield the SDO channels in *indices* with their CAN-IDs, up to the first absent, and all in the EDS."""
    exists = True
    for index in indices:
        if exists or (node.dictionary and node.dictionary.entry(index, 1)):
            said = {word: _number(node, index, sub_index) for sub_index, word in _SDO_WORDS.items()}
            exists = index == SDO_SERVERS[0] or any(raw is not None for raw in said.values())
            yield index, {word: address for word, raw in said.items() if (address := _address(raw))}


def _number(node: ReadableNode, index: int, sub_index: int, size: int = 4) -> int | None:
    try:
        return read_number(node.sdo, index, sub_index, size)
    except (NoAnswer, SdoAborted, SdoProtocolError):
        return None


def _address(raw: int | None) -> Address | None:
    """Return the CAN-ID of a COB-ID, None if absent or disabled by bit 31."""
    if raw is None:
        return None
    cob_id = CobId.from_raw(raw)
    return (cob_id.can_id, cob_id.extended) if cob_id.valid and cob_id.can_id else None


class KnownParties:
    """The known *parties* of a session's bus with their PDOs, and a *decoder* for their frames.

    Without *on_bus* no bus is opened: only the file counts.
    """

    def __init__(
        self, session: SessionNodes, nodes: Iterable[int] = (), file: str | None = None, *, on_bus: bool = True
    ) -> None:
        self._session = session
        self._asked: set[int] = set()
        self.parties, self.decoder = Parties(), Decoder()
        if file is not None:
            self._know_file(file)
        if not on_bus:
            return
        network = session.network
        known = {*nodes, *network.simulated_ids, *network.nodes, *network.bus.nodes_seen(), session.selected_id()}
        self._read(known_id for known_id in known if known_id is not None)

    def look_around(self) -> None:
        """Find new nodes by their traffic, and read them; not if all nodes live in this process."""
        bus = self._session.wire
        if not bus.simulated:
            bus.sleep(HEARD_S)
            self._read(bus.nodes_seen())

    def _read(self, node_ids: Iterable[int]) -> None:
        for node_id in sorted(set(node_ids) - self._asked):
            self._asked.add(node_id)
            try:
                node = self._session.node(node_id)
                configs = node.pdos()
                services = list(node_services(node))
            except BusUnavailable:
                raise
            except (NoAnswer, SdoAborted, SdoProtocolError) as silent:
                self._session.reporter.note(f"node {node_id}: its PDOs cannot be read ({silent.text})")
                continue
            self.parties.add(node_id, configs)
            for address, service in services:
                self.parties.services.setdefault(address, {})[service] = None
                if service.kind in ("sdo", "other"):
                    self.decoder.add({address: Layout(service, (), no_values)})
            scalings = scalings_of(node.profile, node.dictionary)
            self.decoder.add(
                pdo_layouts(node_id, configs, node.dictionary, scalings, mapping_of(self._session, node_id))
            )

    def _know_file(self, file: str) -> None:
        self.decoder.add(file_layouts(file, self._session.reporter))
        if Path(file).suffix.lower() in NETWORK_SUFFIXES:
            from dvtcli.operations.network.described_network import described_network

            for node in described_network(file).nodes:
                self.parties.add(node.node_id, node.pdos)
                self.parties.nodes.discard(node.node_id)  # what the device itself holds is not known by that
