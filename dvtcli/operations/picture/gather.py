"""A network gathered for a picture: from a network file without a bus, or from the nodes on one. Only reads.

Judges nothing and computes nothing itself: rules, load and differences are those of `check`, `load` and `diff`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.bus_need import bus_need, fitting_bit_rates
from dvtcli.domain.network.check.checked_network import CheckedNetwork
from dvtcli.domain.network.frame_streams import streams_of
from dvtcli.domain.network.heard_traffic import HeardTraffic
from dvtcli.domain.network.picture import NetworkPicture, PictureFinding
from dvtcli.errors import NoAnswer, RuleError, SafetyRefusal
from dvtcli.files.network.physical_keys import rules_by_node
from dvtcli.operations.network.check_live import LISTEN_S, against_file
from dvtcli.operations.network.check_networks import CheckOptions, chosen_rules, findings_of, judged_file
from dvtcli.operations.network.live_network import has_bus, listen, live_state, refuse_without_bus
from dvtcli.operations.network.network_load import USUAL_BIT_RATE
from dvtcli.operations.picture.differing_rows import differences
from dvtcli.operations.picture.drawn_frames import drawn_frames, drawn_load
from dvtcli.operations.picture.drawn_nodes import drawn_links, drawn_nodes
from dvtcli.operations.results.loads import Measured, NetworkLoad
from dvtcli.operations.wanted.network_wish import read_wish
from dvtcli.watch.frame_count import FrameCount

if TYPE_CHECKING:
    from dvtcli.domain.meanings import Rules
    from dvtcli.domain.network.network_state import NetworkState
    from dvtcli.domain.network.wanted_state import NetworkWish
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.results.checked_networks import NetworkFinding
    from dvtcli.operations.session.session import Session

#: what passed on the bus: counted for the load, and kept for the rules; None if nobody listened
_Heard = tuple[Measured | None, HeardTraffic | None]


@dataclass(frozen=True, slots=True)
class PictureOptions:
    """How a picture is taken: its *title* (None: the file's or the bus's name), and the *bit_rate* (bit/s) of the bus.

    A bus is listened to for *for_s* seconds (None: 2, and not at all where nobody else can be on it).
    """

    title: str | None = None
    bit_rate: int | None = None
    for_s: float | None = None


def network_picture(session: Session, file: str | None = None, wishes: PictureOptions | None = None) -> NetworkPicture:
    """The network of *file* where there is no bus; else that of the nodes on the bus, compared with *file* if given.

    Raises as `described_network`; UsageError where there is neither, NoAnswer where no node tells what it holds.
    """
    wishes = wishes or PictureOptions()
    if file is not None and not has_bus(session):
        return _of_file(session, file, wishes)
    refuse_without_bus(session)
    return _of_bus(session, file, wishes)


def _of_file(session: Session, file: str, wishes: PictureOptions) -> NetworkPicture:
    told, wish = wishes.bit_rate or session.options.bitrate, read_wish(file)
    state, found = judged_file(file, wish, CheckOptions(bit_rate=told), tell=session.tell)
    return _picture(
        state, wishes.title or Path(file).stem, Path(file).name, told, found, said=rules_by_node(wish.nodes)
    )


def _of_bus(session: Session, file: str | None, wishes: PictureOptions) -> NetworkPicture:
    wish = None if file is None else read_wish(file)
    heard = _heard(session, wishes)
    return session.read_together(lambda: _of_nodes(session, file, wish, wishes, heard))


def _of_nodes(
    session: Session, file: str | None, wish: NetworkWish | None, wishes: PictureOptions, heard: _Heard
) -> NetworkPicture:
    """The picture of the nodes on the bus, on which *heard* was received, compared with the *wish* of *file*."""
    wished = () if wish is None else wish.nodes
    names = {node.node_id: node.name for node in wished}
    measured, traffic = heard
    state = live_state(session, traffic, names)
    if not state.nodes:
        raise NoAnswer(
            f"no node answers on {session.wire.name}: there is nothing to draw",
            hint=Hint(Action.FIND_NODES, why="is it the right bus, and are its nodes on? {} asks every node-ID"),
        )
    state = replace(state, nodes=tuple(replace(node, name=names.get(node.node_id, "")) for node in state.nodes))
    told = wishes.bit_rate or session.wire.bitrate or session.options.bitrate
    network = CheckedNetwork(state, told, traffic)
    found = list(findings_of(network, chosen_rules(CheckOptions())))
    title = wishes.title or (session.wire.name if file is None else Path(file).stem)
    picture = _picture(state, title, session.wire.name, told, found, measured, said=rules_by_node(wished))
    return picture if file is None or wish is None else _compared(session, picture, state, file, wish)


def _heard(session: Session, wishes: PictureOptions) -> _Heard:
    """What passes on the bus: counted for the load, and kept for the rules."""
    simulated = session.wire.simulated
    for_s = wishes.for_s if wishes.for_s is not None else 0.0 if simulated else LISTEN_S
    count, traffic = FrameCount(), HeardTraffic()

    def take(frame: Frame, sent: bool) -> None:
        count.add(frame)
        if not sent:
            traffic.add(frame)

    heard = listen(session, for_s, take)
    if not heard.seconds:
        return None, None
    traffic.seconds, traffic.error_frames = heard.seconds, heard.error_frames
    return Measured(count, heard.seconds, heard.error_frames, heard.lost_frames), traffic


def _compared(
    session: Session, picture: NetworkPicture, live: NetworkState, file: str, wish: NetworkWish
) -> NetworkPicture:
    """*picture*, of the nodes *live*, with what `diff` finds; where that is refused, with why and its exit code."""
    name = Path(file).name
    try:
        return replace(picture, compared=name, differences=tuple(differences(session, file)))
    except (RuleError, NoAnswer, SafetyRefusal) as refused:
        also = [text for label, text in refused.details if label == "also"]
        against = [_finding(finding) for finding in against_file(session, file, wish, live)]
        if not any(finding.severity == "error" for finding in against):
            against.append(PictureFinding("error", "cannot-be-made", refused.text, refused.node, None))
        return replace(
            picture, compared=name, differences=None, exit_code=refused.exit_code,
            findings=(*against, *(finding for finding in picture.findings if finding not in against)),
            notes=(f"not compared with {name}: {'; '.join((refused.text, *also))}",),
        )  # fmt: skip


def _picture(
    state: NetworkState, title: str, source: str, told: int | None, found: Sequence[NetworkFinding],
    measured: Measured | None = None, *, said: Mapping[int, Rules],
) -> NetworkPicture:  # fmt: skip
    told = told or state.bit_rate
    streams, bit_rate = streams_of(state), told or USUAL_BIT_RATE
    load = NetworkLoad(
        bus_need(streams, bit_rate), fitting_bit_rates(streams), is_assumed=told is None, measured=measured
    )
    return NetworkPicture(
        title, source, tuple(drawn_nodes(state, said)), tuple(drawn_links(state)),
        tuple(drawn_frames(state, load)), drawn_load(load), tuple(map(_finding, found)),
    )  # fmt: skip


def _finding(one: NetworkFinding) -> PictureFinding:
    return PictureFinding(one.severity, one.rule, one.text, one.node, one.line if one.column else None)
