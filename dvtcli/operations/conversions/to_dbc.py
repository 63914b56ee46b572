"""All nodes of a network file, or those in a recording, as a DBC file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.files.dbc_text import SUFFIX
from dvtcli.operations.conversions.conversion_format import ConversionFormat, Converted
from dvtcli.operations.exchange.export_network import SUFFIXES as NETWORK_SUFFIXES

if TYPE_CHECKING:
    from dvtcli.operations.results.files import Facts
    from dvtcli.operations.session.session import Session


class DbcFormat(ConversionFormat):
    """The enabled PDOs of all nodes."""

    suffixes = (SUFFIX,)
    instead_of_a_node = "a DBC file has all nodes of a network file"
    has_wishes = True

    def write(self, session: Session, wanted: Converted) -> Facts:
        """Write it, as `convert_to_dbc` and `recording_to_dbc` do."""
        from dvtcli.operations.exchange.export_dbc import convert_to_dbc, recording_to_dbc

        to_dbc = recording_to_dbc if _is_recording(wanted.source) else convert_to_dbc
        return to_dbc(session, wanted.source, wanted.target, wanted.dbc)


def _is_recording(file: str) -> bool:
    """Whether *file* has the suffix of a recording of frames."""
    suffix = Path(file).suffix.lower()
    if suffix in NETWORK_SUFFIXES:
        return False
    from dvtcli.files.recording_formats import formats

    return suffix in formats()
