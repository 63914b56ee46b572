"""python-can's messages as frames, and back. Does not know what a frame means."""

from __future__ import annotations

import can

from dvtcli.domain.ports import Frame


def frame_of(message: can.Message) -> Frame:
    """python-can's message as a frame."""
    return Frame(
        message.arbitration_id,
        bytes(message.data),
        extended=message.is_extended_id,
        remote=message.is_remote_frame,
        timestamp_s=message.timestamp,
    )


def message_of(frame: Frame) -> can.Message:
    """A frame as python-can sends it."""
    return can.Message(
        arbitration_id=frame.can_id, data=frame.data, is_extended_id=frame.extended, is_remote_frame=frame.remote
    )
