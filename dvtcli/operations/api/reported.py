"""A network drawn for a program: by a network file, without a bus. Prints nothing."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.operations.api.called_hints import errors_in_calls
from dvtcli.operations.api.checks import number, path, whole, word
from dvtcli.operations.user.options import BIT_RATES, Options

if TYPE_CHECKING:
    from dvtcli.operations.network.draw_network import PictureOptions


def report(
    target: str | Path, file: str | Path, *, title: str | None = None, bit_rate: int | None = None, yes: bool = False
) -> tuple[str, ...]:
    """Draw the network *file* to *target*: a page (.html), or its wiring alone (.svg, .dot); needs no bus.

    *title* is its heading (None: the file's name); *bit_rate* (bit/s) is the bus's. Returns remarks. Overwriting needs
    *yes*. Raises InputFileError with all errors of *file*; UsageError for another suffix, or if *target* cannot be
    written.
    """
    from dvtcli.operations.network.draw_network import draw_network
    from dvtcli.operations.session.session import Session

    chosen, source, options = (
        str(path("target", target)),
        str(path("file", file)),
        picture_options(title, bit_rate, None),
    )
    with errors_in_calls(), Session(Options(yes=yes)) as session:
        done = draw_network(session, chosen, source, options)
    return tuple(dict(done.rows)["notes"])


def picture_options(title: str | None, bit_rate: int | None, for_s: float | None) -> PictureOptions:
    """How a program wants a picture, checked; UsageError for a wrong argument."""
    from dvtcli.operations.network.draw_network import PictureOptions

    if title is not None:
        word("title", title, "what stands at the top of the page")
    if bit_rate is not None:
        whole("bit_rate", bit_rate, "a bit rate (bit/s)", BIT_RATES[-1], low=BIT_RATES[0])
    if for_s is not None:
        number("for_s", for_s, "a number of seconds, 0…3600", high=3600)
    return PictureOptions(title, bit_rate, for_s)
