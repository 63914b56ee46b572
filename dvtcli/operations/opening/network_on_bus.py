"""The nodes of an open bus, as a session's options and user want them. Does not open a bus, nor look at a node."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from dvtcli.operations.opening.device_files import DeviceFiles
from dvtcli.operations.opening.open_network import Network
from dvtcli.operations.opening.progress_text import look_progress, step_progress

if TYPE_CHECKING:
    from dvtcli.device.change.change_group import ChangeGroup
    from dvtcli.domain.ports import CanopenBus
    from dvtcli.operations.opening.simulated_nodes import Simulated
    from dvtcli.operations.user.keeping import Keeping
    from dvtcli.operations.user.said import SessionOptions


def network_on_bus(
    session: SessionOptions,
    bus: CanopenBus,
    simulated: tuple[Simulated, ...],
    *,
    only_one: Callable[[], bool],
    comes_back: bool,
    whole: ChangeGroup,
) -> Network:
    """The nodes of *bus*, of which some are *simulated*; what is to be said is said to the session's user.

    *only_one* says whether the process makes one change and ends, *comes_back* whether a bus that is gone is waited
    for; changes belong to *whole*.
    """
    return Network(
        bus, DeviceFiles(bus, session.base, simulated), session.cancellation, session.consent,
        None if simulated or (bus.simulated and session.base.sim) else _keeping(session, bus, whole), only_one=only_one,
        on_look=lambda looking: session.tell.progress(*look_progress(looking)),
        on_step=lambda progress: session.tell.progress(*step_progress(progress)),
        warn=session.tell.warning, note=session.tell.note, comes_back=comes_back and not bus.simulated,
        consent_anew=session.consent_anew,
    )  # fmt: skip


def _keeping(session: SessionOptions, bus: CanopenBus, whole: ChangeGroup) -> Keeping:
    """Only of nodes that outlive this process."""
    from dvtcli.operations.user.keeping import Keeping, state_folder

    return Keeping(
        bus.name, state_folder(session.base), session.base.one_node, session.tell.note, session.tell.warning,
        session.doing, whole,
    )  # fmt: skip
