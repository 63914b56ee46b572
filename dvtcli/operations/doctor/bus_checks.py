"""What `doctor` says of the bus: whether it opens, what is heard on it, and whether the selected node answers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import DvtcliError, UsageError
from dvtcli.operations.doctor.failed_check import failed
from dvtcli.operations.results.diagnosis import Check

if TYPE_CHECKING:
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.session.session import Session

#: How long the bus is listened to, in seconds.
LISTEN_S = 1.0
_WORST = "is the bit rate right, the other end powered, and is there a terminator (120 ohm) at each end of the line?"


def bus_checks(session: Session) -> Iterator[Check]:
    """Whether the bus opens, what is heard on it, and whether the selected node answers."""
    from dvtcli.bus.python_can_settings import is_configured

    try:
        session.require_settings()
    except DvtcliError:
        yield Check("bus", "warn", "not opened: who chooses it is not certain", "see `settings` above")
        return
    options = session.options
    if not (options.sim or options.interface or options.channel or is_configured()):
        others = "dvtcli at a terminal offers what is there, or " + Hint(Action.GIVE_INTERFACE, why=" choose {}")
        others += Hint(Action.GIVE_CHANNEL, why=" and {}") + Hint(Action.GIVE_SIMULATED, why=", or {}")
        described = session.settings.described_buses()
        yield Check("bus", "warn", "none is chosen", described + others if described else others)
        return
    try:
        network = session.network
        yield Check("bus", "ok", f"{network.bus.name} opened, chosen by {session.chosen_by()}")
        yield from _heard(session)
        yield from _node(session)
    except DvtcliError as error:
        yield failed("bus", error)


def _heard(session: Session) -> Iterator[Check]:
    """The traffic of a second."""
    bus, frames = session.wire, 0

    def count(_frame: Frame, sent: bool) -> None:
        nonlocal frames
        frames += not sent

    stop, before = bus.tap(count), bus.error_frame_count()
    try:
        bus.sleep(LISTEN_S)
    finally:
        stop()
    if not bus.carries_frames:
        yield Check("traffic", "ok", "no CAN frames are carried: objects are read and written")
        return
    errors, nodes = bus.error_frame_count() - before, sorted(bus.heard_nodes())
    if errors:
        told = "; ".join(bus.disturbances()) or _WORST
        yield Check("traffic", "FAIL", f"{errors} error frames and {frames} frames in {LISTEN_S:g} s", told, 5)
    elif frames or bus.simulated:
        yield Check("traffic", "ok", f"{frames / LISTEN_S:.0f} frames/s, no error frames")
    else:
        yield Check(
            "traffic", "warn", f"nothing was heard in {LISTEN_S:g} s", f"nodes may be quiet: scan asks them. {_WORST}"
        )
    yield Check("heartbeats", "ok", f"heard of node {', '.join(map(str, nodes))}" if nodes else "none was heard")


def _node(session: Session) -> Iterator[Check]:
    """Whether the selected node answers, and by which files it is known."""
    try:
        node_id = session.node_id()
    except UsageError:
        yield Check("node", "ok", "none is selected")
        return
    try:
        node = session.node(node_id)
        node.sdo.upload(0x1000, 0)
    except DvtcliError as silent:
        yield failed("node", silent)
        return
    if node.dictionary is None:
        hint = Hint(Action.GIVE_EDS, why="objects have no names: {}")
        hint += Hint(Action.ADD_EDS, why=", or {} once and for all")
        yield Check("node", "warn", f'node {node_id} "{node.title}" answers; no EDS is known for it', hint)
        return
    if node.unlike_file:
        hint = Hint(Action.FORCE, why="changes need {}")
        hint += Hint(Action.GIVE_EDS, why=": give the {} of this device, or none")
        yield Check("node", "warn", f"node {node_id} answers; {node.unlike_file}", hint)
        return
    yield Check("node", "ok", f'node {node_id} "{node.title}" answers; {node.dictionary.source}')
