"""What it costs that nobody said a bus's bit rate, told where several nodes are asked. Does not know what is asked."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint, verbatim

if TYPE_CHECKING:
    from dvtcli.operations.session.session import Session


def tell_unknown_bit_rate(session: Session, nodes: int) -> None:
    """Say that so many *nodes* are asked slowly where the bit rate is not known, and how to say it; once a session.

    Of a bus alone that would ask them faster: not of simulated nodes, twins, or a gateway to objects.
    """
    bus = session.bus
    if nodes < 2 or session.dry_run or bus.simulated or not bus.carries_frames or bus.bitrate is not None:
        return
    unknown = f"the bit rate of {bus.name} is not known"
    if not session.network.files.is_news(unknown):
        return
    session.tell.note(
        Hint(
            Action.GIVE_BIT_RATE,
            {"rate": 250000},
            f"{verbatim(unknown)}: its {nodes} nodes are asked slowly, and nothing of the bus is kept free for a "
            "running machine; say what it is, as {} or as bitrate = 250000 in dvtcli.toml",
        )
    )
