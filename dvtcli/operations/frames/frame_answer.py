"""Turn a frame and its decoding into a result."""

from __future__ import annotations

from dvtcli.domain.ports import Frame
from dvtcli.operations.results.frames import FrameSeen
from dvtcli.watch.decoder import Decoder
from dvtcli.watch.frame_reader import Reading
from dvtcli.watch.layout_fit import misfit


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
