"""Convert files for a program. Opens no bus and prints nothing."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.operations.api.called_hints import errors_in_calls
from dvtcli.operations.api.checks import flags, path, words
from dvtcli.operations.user.options import Options

if TYPE_CHECKING:
    from dvtcli.operations.exchange.dbc_options import DbcOptions


def convert(
    file: str | Path,
    target: str | Path,
    *,
    node: str | int | None = None,
    services: Sequence[str] = (),
    split_bits: bool = False,
    everything: bool = False,
    eds: str | Path | None = None,
    yes: bool = False,
) -> tuple[str, ...]:
    """Convert *file* to *target*, in the format of its suffix: EDS to XDD, DCF to XDC, and back.

    A network file becomes the concise DCF (.cdcf) of *node*, by name or node-ID (None: its only node), or a DBC file
    (.dbc) of all nodes: *services* (`nmt`, `sync`, `emcy`, `heartbeat`, `sdo`) adds their frames, *split_bits* makes a
    signal of each named bit, *everything* adds disabled PDOs. A recording becomes a DBC file of the PDOs in its SDO
    transfers, with names of *eds* (None: by the recorded identity). Returns what *target* lacks. Overwriting needs
    *yes*. Raises UsageError for another suffix, if a file cannot be read or written, or if a recording has no mapping;
    InputFileError if *file* is invalid.
    """
    from dvtcli.operations.conversions.convert_file import convert_file
    from dvtcli.operations.session.session import Session

    source, chosen = str(path("file", file)), str(path("target", target))
    described = None if eds is None else str(path("eds", eds))
    wishes = dbc_wishes(services, split_bits=split_bits, everything=everything)
    with errors_in_calls(), Session(Options(yes=yes, eds=described)) as session:
        done = dict(convert_file(session, source, chosen, node, wishes).rows)
    return tuple(done.get("left_out") or done.get("losses") or ())


def dbc_wishes(services: Sequence[str], *, split_bits: bool, everything: bool) -> DbcOptions:
    """How a program wants a DBC file, checked; UsageError for a wrong argument."""
    from dvtcli.operations.exchange.dbc_options import DbcOptions
    from dvtcli.operations.exchange.service_messages import services_of

    flags(split_bits=split_bits, everything=everything)
    return DbcOptions(services_of(",".join(words("services", services))), split_bits, everything)
