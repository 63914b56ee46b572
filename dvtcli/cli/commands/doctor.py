"""Check the set-up: packages, settings, interfaces, bus, node, journals."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.operations.results.facts import Check

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.results import Diagnosis


@click.command("doctor", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE, needs_settings=False)
@click.pass_obj
def command(session: Conversation, /) -> Diagnosis:
    """Check everything that dvtcli needs, and show the next step if something is missing.

    It listens to the bus for a second and reads one object of the selected node; it writes nothing.

    \b
    doctor
    doctor --json
    """
    from dvtcli.operations.nodes.diagnose import checks
    from dvtcli.operations.results import Diagnosis

    return Diagnosis((*checks(session), _terminal(session)))


def _terminal(session: Conversation) -> Check:
    """How results are shown here."""
    stream = session.output.stdout
    encoding = getattr(stream, "encoding", None) or "utf-8"
    drawn = "ASCII look-alikes" if session.options.ascii or "utf" not in encoding.lower() else "Unicode"
    if not stream.isatty():
        return Check("terminal", "ok", f"no terminal: no colours, {drawn} ({encoding}), no questions")
    size = os.get_terminal_size(stream.fileno())
    usual = "console" if os.name == "nt" else "?"
    text = f"{os.environ.get('TERM', usual)}, {size.columns} x {size.lines}, {drawn} ({encoding})"
    if size.columns < 80:
        return Check("terminal", "warn", text, "screens are made for 80 columns and more")
    return Check("terminal", "ok", text)
