"""A file as one of another format, which its suffix says: those of `conversion_formats`.

Needs no bus, and does not know what is in the files.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import UsageError
from dvtcli.operations.conversions.conversion_format import Converted
from dvtcli.operations.exchange.dbc_options import DbcOptions

if TYPE_CHECKING:
    from dvtcli.operations.conversions.conversion_format import ConversionFormat
    from dvtcli.operations.results.files import Facts
    from dvtcli.operations.session.session import Session


@cache
def conversion_formats() -> Mapping[str, ConversionFormat]:
    """Every format by its suffixes."""
    from dvtcli.operations.conversions.to_concise_dcf import ConciseDcfFormat
    from dvtcli.operations.conversions.to_dbc import DbcFormat
    from dvtcli.operations.conversions.to_device_file import DeviceFileFormat

    formats: tuple[ConversionFormat, ...] = (ConciseDcfFormat(), DbcFormat(), DeviceFileFormat())
    return {suffix: format_ for format_ in formats for suffix in format_.suffixes}


def convert_file(
    session: Session, file: str, target: str, node: str | int | None = None, wishes: DbcOptions | None = None
) -> Facts:
    """Write what *file* says of a device to *target*, in the format that its name ends in, and say what it cannot hold.

    An EDS or XDD holds no values of one node. A .cdcf is made of *node* of a network file, a .dbc of all
    its nodes, or of those in a recording, by *wishes*. Asks before it overwrites.
    UsageError where *target* has another suffix, or a file cannot be read or written; InputFileError where *file* is
    none.
    """
    kind = _format_of(target)
    if wishes and not kind.has_wishes:
        raise UsageError(
            f"{target} is no DBC file, which alone can have that",
            given=dict.fromkeys(wishes.named),
            hint=Hint(Action.CONVERT, {"file": "net.yaml", "target": "net.dbc", "services": "emcy"}),
        )
    if node is not None and kind.instead_of_a_node:
        raise UsageError(
            "a node of a network file is chosen for a concise DCF", given={"node": node}, hint=kind.instead_of_a_node
        )
    return kind.write(session, Converted(file, target, node, wishes or DbcOptions()))


def _format_of(target: str) -> ConversionFormat:
    """The format of *target*; that of device files, which says what there is, where nobody knows the suffix."""
    known, name = conversion_formats(), target.lower()
    return next((conversion for suffix, conversion in known.items() if name.endswith(suffix)), known[".eds"])
