"""Explain every bit of a frame. Does not send it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from dvtcli.domain.typed_frame import typed_frame
from dvtcli.errors import UsageError
from dvtcli.operations.frames.layouts import network_wish
from dvtcli.operations.frames.recorded import decoder_for
from dvtcli.operations.meanings.physical_meanings import meanings_of
from dvtcli.operations.results.frames import FrameExplained
from dvtcli.watch.explain.frame_parts import frame_parts
from dvtcli.watch.explain.known_node import KnownNode
from dvtcli.watch.frame_reader import FrameReader
from dvtcli.watch.layout_fit import doubts

if TYPE_CHECKING:
    from dvtcli.domain.network.wanted_state import NetworkWish
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.session.session_nodes import SessionNodes

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
    is no frame.
    """
    frame = parsed_frame(text)
    wish = network_wish(file)
    decoder = decoder_for(session, nodes, file, wish=wish)
    for doubt in doubts(frame, decoder.layout(frame)):
        session.tell.warning(doubt)
    return explained(frame, FrameReader(decoder, described_nodes(session, file, wish)))


def explained(frame: Frame, reader: FrameReader) -> FrameExplained:
    """Explain every bit of *frame*, the next frame for *reader*."""
    service = reader.decoder.layout(frame).service
    parts = tuple(frame_parts(frame, reader.decoder, reader.described))
    return FrameExplained(frame, service.kind, service.label, service.node, parts, reader.read(frame))


def described_nodes(
    session: SessionNodes, file: str | None = None, wish: NetworkWish | None = None
) -> Callable[[int], KnownNode]:
    """Return what describes a node-ID: the network file, else the node if met, else --eds, of the nodes of -n if given.

    *wish* is the network file as read, if read already. Asks no node. Raises as the reading of the files: no frame does
    so later.
    """
    wish = wish or network_wish(file)
    known = {} if file is None or wish is None else _network_nodes(file, wish)
    offline: list[KnownNode] = []
    if session.base.eds is not None:
        from dvtcli.operations.opening.device_files import offline_dictionaries

        offline = [
            KnownNode(dictionary, meanings_of(profile, dictionary))
            for dictionary, profile in offline_dictionaries(session.base)
        ]
    nobody = KnownNode(None, meanings_of(None, None))

    def described(node_id: int) -> KnownNode:
        node = session.network.nodes.get(node_id) if session.is_open else None
        if node is not None and node_id not in known:
            known[node_id] = KnownNode(node.dictionary, meanings_of(node.profile, node.dictionary))
        is_of_eds = not session.base.nodes or node_id in session.base.nodes
        return known.get(node_id) or (next(iter(offline), nobody) if is_of_eds else nobody)

    return described


def _network_nodes(file: str, wish: NetworkWish) -> dict[int, KnownNode]:
    """Return the nodes of the network *file*, read as *wish*, of which nothing is planned."""
    from dvtcli.files.network.physical_keys import rules_by_node
    from dvtcli.operations.network.described_network import simulation_of, words_of
    from dvtcli.operations.opening.device_files import offline_dictionaries

    own, words = rules_by_node(wish.nodes), words_of(file, wish)
    devices = offline_dictionaries(simulation_of(words))
    told = dict(zip(words, devices, strict=True))
    return {
        node.node_id: KnownNode(dictionary, meanings_of(profile, dictionary, [own.get(node.node_id, {})]))
        for node in wish.nodes
        for dictionary, profile in (told.get(node.node_id, (None, None)),)
    }
