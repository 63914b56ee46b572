"""A bus that is lost in the middle of a line: what that line had sent by then, so that nobody is told `unchanged`.

Does not know what was to be done: what is changed by a plan says by itself in which state it leaves a device.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from dvtcli.domain.several import join_some
from dvtcli.errors import BusUnavailable, DvtcliError, LeftChanged, NoAnswer


def judge_lost_bus(error: DvtcliError, acts: Callable[[], Sequence[str]]) -> None:
    """Where *error* is a lost bus that says `unchanged`, and *acts* of this line went out: not known is true."""
    if not isinstance(error, BusUnavailable) or error.state != "unchanged" or error.state_text is not None:
        return
    if sent := acts():
        error.state = "unknown"
        error.state_text = f"unknown: {join_some(sent)} went out before that; read back what the device holds"


def read_in_vain(error: DvtcliError) -> DvtcliError:
    """What kept a twin from reading its node, where *error* says that the twin was left changed by that: else *error*.

    A twin that cannot be put back tells what would become of the node only where the node still answers.
    """
    cause: BaseException | None = error
    while isinstance(cause, LeftChanged):
        cause = cause.__cause__
    return cause if isinstance(cause, BusUnavailable | NoAnswer) else error
