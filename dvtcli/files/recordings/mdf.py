"""ASAM's measurement data, by the package asammdf."""

from __future__ import annotations

from importlib.util import find_spec

from dvtcli.errors import UsageError
from dvtcli.files.recordings.recording_format import RecordingFormat
from dvtcli.version import DISTRIBUTION


class MdfFormat(RecordingFormat):
    """ASAM's .mf4."""

    suffix = ".mf4"
    title = "ASAM MDF, needs asammdf"

    def require(self) -> None:
        """UsageError where asammdf is not installed."""
        if find_spec("asammdf") is None:
            raise UsageError(".mf4 files need asammdf", hint=f"pip install '{DISTRIBUTION}[mdf]'")
