"""Files of one format as files of another, for a program. Opens no bus and prints nothing."""

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
    """Write what *file* says to *target*, in the format that its name ends in: EDS to XDD, DCF to XDC, and back.

    Of a network file a concise DCF (.cdcf) is made for *node*, its name or node-ID (None: the only one), and a DBC file
    (.dbc) for all nodes: with the frames of *services* (`nmt`, `sync`, `emcy`, `heartbeat`, `sdo`), with *split_bits*
    as one signal for each bit that may have a name, with *everything* also of PDOs that are off. Of a recording a DBC
    file has what its SDO transfers say, with the names of *eds* (None: of the file that the identity in it is of). The
    answer is what *target* does not say. Writing over a file needs *yes*. UsageError for another suffix, where a file
    cannot be read or written, or where a recording says no mapping; InputFileError where *file* is none.
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
