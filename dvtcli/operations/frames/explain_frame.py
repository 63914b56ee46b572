"""Explain every bit of a frame. Does not send it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.ports import Frame
from dvtcli.domain.typed_frame import typed_frame
from dvtcli.errors import UsageError
from dvtcli.operations.frames.recorded import decoder_for
from dvtcli.operations.network.described_nodes import described_nodes, network_config_of
from dvtcli.operations.results.frames import FrameExplained, FrameSeen
from dvtcli.watch.decoder import Decoder, doubts, misfit
from dvtcli.watch.explain.frame_parts import frame_parts
from dvtcli.watch.frame_reader import FrameReader, Reading

if TYPE_CHECKING:
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
