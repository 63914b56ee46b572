"""A bus that is lost in the middle of a line: what that line had sent by then, so that nobody is told `unchanged`.

Does not know what was to be done: what is changed by a plan says by itself in which state it leaves a device.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.several import several
from dvtcli.errors import BusUnavailable, DvtcliError

if TYPE_CHECKING:
    from dvtcli.operations.opening.opened import Opened


def judge_lost_bus(session: Opened, error: DvtcliError) -> None:
    """Where *error* is a lost bus that says `unchanged`, and the line had sent what nodes act on: not known is true."""
    if not isinstance(error, BusUnavailable) or error.state != "unchanged" or error.state_text is not None:
        return
    sent = session.acts()
    if sent:
        error.state = "unknown"
        error.state_text = f"unknown: {several(sent)} went out before that; read back what the device holds"
