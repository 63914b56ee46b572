"""The SYNC message of a node."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.ports import Frame
from dvtcli.errors import NoAnswer, SdoAborted

if TYPE_CHECKING:
    from dvtcli.domain.ports import SdoTransport

#: the default SYNC (CiA 301, 7.5.2.5)
DEFAULT = Frame(0x080, b"")
_EXTENDED = 1 << 29


def sync_frame(sdo: SdoTransport) -> Frame:
    """Return a SYNC with the CAN-ID of the node's 0x1005; 0x080 if absent or unanswered."""
    try:
        raw = int.from_bytes(sdo.upload(0x1005, 0, retries=0)[:4], "little")
    except (NoAnswer, SdoAborted):
        return DEFAULT
    if raw & _EXTENDED:
        return Frame(raw & 0x1FFF_FFFF, b"", extended=True)
    return Frame(raw & 0x7FF, b"") if raw & 0x7FF else DEFAULT
