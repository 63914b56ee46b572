"""Captures of CAN frames: Wireshark's pcapng, and tcpdump's pcap (read only)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import can

from dvtcli.files.recordings.recording_format import RecordingFormat


class PcapFormat(RecordingFormat):
    """tcpdump's .pcap."""

    suffix = ".pcap"
    title = "tcpdump"
    is_written = False
    tells = True

    def source(self, raw: BinaryIO, _path: Path) -> Any:
        """The file itself."""
        return raw

    def reader(self, source: Any) -> Iterator[can.Message]:
        """Iterate over frames among the packets; the first bytes tell pcap from pcapng."""
        from dvtcli.files.recordings.captures import read_capture

        return read_capture(source)


class PcapngFormat(PcapFormat):
    """Wireshark's .pcapng."""

    suffix = ".pcapng"
    title = "Wireshark"
    is_written = True
    flushes = True

    def writer(self, path: Path, *, append: bool, most_bytes: int) -> Any:  # noqa: ARG002 - it declares neither
        """Return a writer of one interface's frames to *path*."""
        from dvtcli.files.recordings.captures import PcapngWriter

        return PcapngWriter(path)
