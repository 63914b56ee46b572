"""Send SYNC messages and show the frames that answer, or find the SYNC producer."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import MillisecondsType, NumberType
from dvtcli.operations.user.refused_options import refuse_options

if TYPE_CHECKING:
    from dvtcli.operations.results import SyncCheck, Synced
    from dvtcli.operations.session.session import Session


@click.command("sync", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE)
@click.option("--period", type=MillisecondsType(1000), metavar="MS", help="Time between SYNC messages [20].")
@click.option("--count", type=NumberType(1, 100_000, "a count"), metavar="N", help="How many [1].")
@click.option("--check", is_flag=True, help="Send nothing; find the SYNC producer, and warn if there is none.")
@click.pass_obj
def command(session: Session, /, period: int | None, count: int | None, check: bool) -> Synced | SyncCheck:
    """Produce SYNC and list the frames that synchronous PDOs send.

    Its CAN-ID is that of the selected node's 0x1005; 0x080 if no node is selected.

    \b
    sync
    sync --period 20 --count 50
    sync --check
    """
    if check:
        if period is not None or count is not None:
            raise click.UsageError("--check sends no SYNC: leave --period and --count out")
        from dvtcli.operations.pdos.sync import check_sync

        return check_sync(session)
    if count is None:
        refuse_options({"period": period}, "only with --count: one SYNC has no period")
    from dvtcli.operations.pdos.produce_sync import produce_sync

    return produce_sync(session, count or 1, (20 if period is None else period) / 1000)
