"""Reconstruct nodes from SDO transfers in a recording. Opens no bus."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import WHATEVER, read_identity, read_pdo
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.network_state import IDENTITY_NAMES, Identifier, NetworkState, NodeState, identifier_of
from dvtcli.domain.objects import IDENTITY
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.text import join_some
from dvtcli.errors import InputFileError, SdoAborted, SdoProtocolError, UsageError
from dvtcli.watch.sdo_transfers import ReceivedObjects, is_boot_up

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.pdo import PdoConfig, PdoMappingEntry
    from dvtcli.domain.ports import Frame
    from dvtcli.domain.profile import DeviceProfile
    from dvtcli.operations.user.session_user import SessionUser
    from dvtcli.watch.sdo_transfers import ReceivedValues

_HINT = Hint(
    Action.SHOW_PDOS,
    why="record while {} reads the nodes or a master configures them, or use a network file, which needs no frames",
)
_COB_ID = 1
#: a PDO's CAN-ID and mapping
_Drawn = tuple[Identifier, "tuple[PdoMappingEntry, ...]"]


def recorded_network(session: SessionUser, path: Path, *, throughout: bool = False) -> tuple[NetworkState, list[str]]:
    """Return the nodes of the recording at *path* with known PDOs, or those of `-n`; and what is missing.

    The last value counts; a boot-up returns to stored values. *throughout* leaves out, with a warning, PDOs whose
    CAN-ID or mapping changed, or may have changed. Raises UsageError if no PDO is known, or SDO transfers are on
    several channels; else as `read_recorded`.
    """
    followed = _Followed()
    _follow(path, followed, until_damage=throughout)
    wanted = session.base.nodes
    nodes, missing = (
        [],
        [
            f"node {wanted_id}: no mapping received"
            for wanted_id in wanted
            if wanted_id not in followed.received.node_ids
        ],
    )
    for node_id in followed.received.node_ids:
        if not wanted or node_id in wanted:
            pdos = _whole_pdos(node_id, followed, missing)
            if throughout:
                unsure = followed.changed | followed.late
                pdos = {pdo: config for pdo, config in pdos.items() if (node_id, pdo) not in unsure}
                pdos = _working_pdos(session, node_id, pdos, followed)
            nodes += [_node_state(session, followed.received.values(node_id), pdos)] if pdos else []
    if not nodes:
        if throughout:
            _tell_changed(session, followed, throughout=True)
        why = "; ".join(missing) or "no SDO transfer in it has a COB-ID and a mapping"
        raise UsageError(f"{path} does not show the mapping of its PDOs: {why}", hint=_HINT, place=str(path))
    _tell_changed(session, followed, throughout=throughout)
    return NetworkState(tuple(nodes)), missing


def _working_pdos(
    session: SessionUser, node_id: int, pdos: Mapping[Pdo, PdoConfig], followed: _Followed
) -> dict[Pdo, PdoConfig]:
    """Return the enabled *pdos* with a mapping; warns of others whose frames were seen: their mapping is unknown."""
    working = {pdo: config for pdo, config in pdos.items() if config.enabled and config.mapping}
    for pdo, config in pdos.items():
        if pdo not in working and identifier_of(config) in followed.seen:
            text = (
                f"{pdo.label} of node {node_id} is {'without a mapping' if config.enabled else 'disabled'} at the end"
            )
            session.reporter.warning(f"{text}: the mapping of its frames is unknown, they remain bytes")
    return working


def _tell_changed(session: SessionUser, followed: _Followed, *, throughout: bool) -> None:
    """Warn of PDOs changed during the recording, of all nodes or those of `-n`."""
    wanted = session.base.nodes
    counts = "its mapping changed between frames: they remain bytes" if throughout else "its last setting is used"
    for node_id, pdo in sorted(followed.changed):
        if not wanted or node_id in wanted:
            session.reporter.warning(f"{pdo.label} of node {node_id} had other settings before: {counts}")
    for node_id, pdo in sorted(followed.late - followed.changed if throughout else ()):
        if not wanted or node_id in wanted:
            text = "was configured after its first frames, whose mapping is unknown: all remain bytes"
            session.reporter.warning(f"{pdo.label} of node {node_id} {text}")


@dataclass(slots=True)
class _Followed:
    """Values *received*; the last complete layout of each enabled PDO, and PDOs with several layouts.

    *late*: the CAN-ID was *seen* before a download (*written*) completed the PDO, so the layout of earlier frames is
    unknown; values of uploads held before, too. *lost*: the node restarted without storing it, so the layout of later
    frames is unknown.
    """

    received: ReceivedObjects = field(default_factory=ReceivedObjects)
    drawn: dict[tuple[int, Pdo], _Drawn] = field(default_factory=dict)
    changed: set[tuple[int, Pdo]] = field(default_factory=set)
    late: set[tuple[int, Pdo]] = field(default_factory=set)
    seen: set[Identifier] = field(default_factory=set)
    written: set[tuple[int, Pdo]] = field(default_factory=set)
    lost: set[tuple[int, Pdo]] = field(default_factory=set)

    def take(self, frame: Frame) -> bool:
        """Follow *frame*; returns whether it ends an SDO transfer."""
        received = self.received.take(frame)
        if received is None:
            self.seen.add((frame.can_id, frame.extended))
            if is_boot_up(frame):
                self._start(frame.can_id & 0x7F)
            return False
        node_id, (index, sub_index) = received.node_id, received.place
        pdo = Pdo.at(index)
        if pdo is not None:
            if received.is_written and (index == pdo.mapping_index or sub_index == _COB_ID):
                self.written.add((node_id, pdo))
            self._draw(node_id, pdo)
        return True

    def _start(self, node_id: int) -> None:
        """After a restart, find the PDOs that the node did not store."""
        for node_pdo in [
            node_pdo for node_pdo in self.drawn if node_pdo[0] == node_id and self._whole(*node_pdo) is None
        ]:
            self.lost.add(node_pdo)
            self.written.discard(node_pdo)
            self.seen.discard(self.drawn[node_pdo][0])

    def _whole(self, node_id: int, pdo: Pdo) -> PdoConfig | None:
        """Return *pdo* if it is enabled and completely known."""
        config = _received_pdo(self.received.values(node_id), pdo)
        return None if config is None or not config.enabled or config.unread else config

    def _draw(self, node_id: int, pdo: Pdo) -> None:
        """Update *pdo* after a new value."""
        config, one = self._whole(node_id, pdo), (node_id, pdo)
        if config is None:
            return
        drawn = identifier_of(config), config.mapping
        if (one not in self.drawn or one in self.lost) and one in self.written and drawn[0] in self.seen:
            self.late.add(one)
        self.lost.discard(one)
        if self.drawn.setdefault(one, drawn) != drawn:
            self.changed.add(one)
            self.drawn[one] = drawn


def _follow(path: Path, followed: _Followed, *, until_damage: bool) -> None:
    """Follow the frames of the recording at *path*; *until_damage*: who decodes these frames then tells the damage."""
    from dvtcli.files.recordings.recording_file import read_recorded

    channels: set[str] = set()
    try:
        for frame in read_recorded(path):
            if not frame.error and not frame.fd and followed.take(frame.frame):
                channels.add(frame.channel)
    except InputFileError:
        if not until_damage:
            raise
    if len(channels) > 1:
        named = join_some(sorted(channels))
        hint = "record each bus into a file of its own"
        raise UsageError(f"{path} has SDO transfers of several channels ({named}): two buses?", hint=hint)


def _received_pdo(values: ReceivedValues, pdo: Pdo) -> PdoConfig | None:
    """Return *pdo* as far as known; None if nothing is, or bytes are invalid."""
    try:
        return read_pdo(values, pdo, WHATEVER)
    except (SdoAborted, SdoProtocolError):
        return None


def _whole_pdos(node_id: int, followed: _Followed, missing: list[str]) -> dict[Pdo, PdoConfig]:
    """Return completely known PDOs; *missing* gets what others lack that may be enabled."""
    values = followed.received.values(node_id)
    known = {pdo for index, _ in values.values if (pdo := Pdo.at(index)) is not None}
    whole: dict[Pdo, PdoConfig] = {}
    for pdo in sorted(known | {drawn_pdo for node, drawn_pdo in followed.drawn if node == node_id}):
        config = _received_pdo(values, pdo)
        after = " after the node's last boot-up" if (node_id, pdo) in followed.drawn else ""
        if config is None:
            missing.append(f"{pdo.label} of node {node_id}: no frame was received{after}")
        elif not config.unread:
            whole[pdo] = config
        elif config.enabled or not config.has_cob_id:
            index, sub_index = config.unread[0]
            missing.append(f"{pdo.label} of node {node_id}: {index:04X}:{sub_index:02X} was not received{after}")
    return whole


def _node_state(session: SessionUser, values: ReceivedValues, pdos: dict[Pdo, PdoConfig]) -> NodeState:
    from dvtcli.operations.plans.network_states import timing_numbers

    dictionary = _dictionary(session, values)
    if dictionary is None:
        session.reporter.note(
            Hint(
                Action.GIVE_EDS,
                why=f"node {values.node_id} has no EDS: its values have no names and are unsigned; {{}} adds them",
            )
        )
    title = "" if dictionary is None else dictionary.info.product_name
    profile = _profile(session, values, dictionary)
    numbers = timing_numbers(values)
    for sub_index in range(1, len(IDENTITY_NAMES) + 1):
        if (number := read_identity(values, sub_index)) is not None:
            numbers[IDENTITY, sub_index] = number
    return NodeState(values.node_id, "", pdos, numbers, dictionary, profile, title or profile.title)


def _dictionary(session: SessionUser, values: ReceivedValues) -> ObjectDictionary | None:
    """Return --eds if it may describe the node, else the file of its recorded identity (0x1018)."""
    from dvtcli.device.file_fits import unlike_file
    from dvtcli.operations.session.device_files import found_file, with_modules_of
    from dvtcli.operations.session.simulated_nodes import file_or_family
    from dvtcli.operations.user.options import modules_of_node

    modules = modules_of_node(session.base.modules, values.node_id)
    if session.base.eds:
        chosen = with_modules_of(file_or_family(session.base.eds), modules, values)
        unlike = unlike_file(values.node_id, chosen, (read_identity(values, 1), read_identity(values, 2)))
        if not unlike:
            return chosen
        session.reporter.note(unlike)
    found = found_file(values)
    if found is not None and found.note:
        session.reporter.note(f"node {values.node_id}: {found.note}")
    return None if found is None else with_modules_of(found.path, modules, values)


def _profile(session: SessionUser, values: ReceivedValues, dictionary: ObjectDictionary | None) -> DeviceProfile:
    from dvtcli.files.profiles import load_profile, profile_for_identity, profile_of

    if session.base.profile:
        return load_profile(session.base.profile)
    vendor, product = read_identity(values, 1), read_identity(values, 2)
    return profile_for_identity(vendor, product or 0) if vendor else profile_of(dictionary)
