"""Report what an unknown bit rate costs if several nodes are read."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint, verbatim

if TYPE_CHECKING:
    from dvtcli.operations.session.session_nodes import SessionNodes


def tell_unknown_bit_rate(session: SessionNodes, nodes: int) -> None:
    """Report, once a session, that *nodes* nodes are read one by one as the bit rate is unknown, with a hint.

    Only for a bus that could read them in parallel: not for simulated nodes, twins, or an object gateway.
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
            f"{verbatim(unknown)}: its {nodes} nodes are read slowly, and no bus load is kept free for a "
            "running machine; give it, as {} or as bitrate = 250000 in dvtcli.toml",
        )
    )
