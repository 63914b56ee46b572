"""A bus that is lost in the middle of a line: what that line had sent by then, so that nobody is told `unchanged`.

Does not know what was to be done: what is changed by a plan says by itself in which state it leaves a device.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from dvtcli.domain.several import several
from dvtcli.errors import BusUnavailable, DvtcliError


def judge_lost_bus(error: DvtcliError, acts: Callable[[], Sequence[str]]) -> None:
    """Where *error* is a lost bus that says `unchanged`, and *acts* of this line went out: not known is true."""
    if not isinstance(error, BusUnavailable) or error.state != "unchanged" or error.state_text is not None:
        return
    if sent := acts():
        error.state = "unknown"
        error.state_text = f"unknown: {several(sent)} went out before that; read back what the device holds"
