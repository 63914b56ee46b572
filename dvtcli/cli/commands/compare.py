"""Compare a whole device, or a file, with a file; exit code 3 if a setting differs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import FILE
from dvtcli.operations.user.options import CASE_FORMATS

if TYPE_CHECKING:
    from dvtcli.operations.results import WholeCompared
    from dvtcli.operations.session.session import Session


@click.command("compare", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE, formats=CASE_FORMATS)
@click.argument("file", type=FILE)
@click.argument("other", type=FILE, required=False)
@click.option("--all", "everything", is_flag=True, help="Also show differences that are not settings.")
@click.pass_obj
def command(session: Session, /, file: str, other: str | None, everything: bool) -> WholeCompared:
    """Compare the settings of the selected node, or of the file OTHER, with FILE. If no node is selected, it is the
    node whose node-ID FILE has.

    A file is a DCF, EDS, XDD or XDC, or a backup's .jsonl. Values are compared by meaning. Settings are objects that a
    file may write. Versions, commands, measured values and values that change by themselves are listed and do not
    count: --all shows the reasons. An object without a ParameterValue in a DCF is not compared; an EDS stands for its
    defaults.
    --format github or junit is for CI.

    \b
    compare press.dcf
    compare press.dcf --all
    compare monday.dcf friday.dcf
    compare press.dcf --format junit   a test case for each setting that differs, for CI
    """
    from dvtcli.operations.devices.compare_device import compare_device

    return compare_device(session, file, other, shows_all=everything)
