"""Convert python-can's messages to frames."""

from __future__ import annotations

import logging

import can

from dvtcli.domain.ports import Frame

# python-can logs raw lines of files, and errors that it also raises: without a handler, logging prints them on stderr.
for _logger in ("can", "seeedbus"):
    logging.getLogger(_logger).addHandler(logging.NullHandler())


def frame_of(message: can.Message) -> Frame:
    """python-can's message as a frame."""
    is_remote = message.is_remote_frame
    return Frame(
        message.arbitration_id,
        bytes(message.data),
        message.is_extended_id,
        is_remote,
        message.timestamp,
        message.dlc if is_remote else 0,
    )
