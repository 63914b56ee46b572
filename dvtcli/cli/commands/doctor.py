"""Check the set-up: packages, settings, interfaces, bus, node, and what is kept."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.effect import Effect

if TYPE_CHECKING:
    from dvtcli.operations.results import Diagnosis
    from dvtcli.operations.session import Session

TASK = ("Begin", 20)


@click.command("doctor", cls=DvtCommand, short_help=__doc__, effect=Effect.READS, needs_settings=False)
@click.pass_obj
def command(session: Session, /) -> Diagnosis:
    """Look at everything that dvtcli needs, and say the next step where something is missing.

    It listens to the bus for a second and reads one object of the selected node; it writes nothing.

    \b
    doctor
    doctor --json
    """
    from dvtcli.operations.diagnose import checks
    from dvtcli.operations.results import Diagnosis

    return Diagnosis(tuple(checks(session)))
