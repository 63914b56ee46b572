"""A network as a page (HTML), a drawing (SVG) or a graph (Graphviz): read from a file or the bus. Writes no node."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

from dvtcli.domain.frame import layout
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.check.checked_network import CheckedNetwork
from dvtcli.domain.network.links import agrees
from dvtcli.domain.network.network_config import Endpoint
from dvtcli.domain.network.network_state import identifier_of, identifier_text
from dvtcli.domain.network.picture import (
    NetworkPicture,
    PictureDifference,
    PictureField,
    PictureFinding,
    PictureFrame,
    PictureLink,
    PictureLoad,
    PictureNode,
    PicturePdo,
)
from dvtcli.domain.network.received_traffic import ReceivedTraffic
from dvtcli.domain.network.worst_case_load import fitting_bit_rates, streams_of, worst_case_load
from dvtcli.domain.objects import COB_ID_EMCY, CYCLE_PERIOD
from dvtcli.domain.plan import PdoChange
from dvtcli.domain.text import plural
from dvtcli.errors import NoAnswer, RuleError, SafetyRefusal, UsageError, ended_with
from dvtcli.files.network.read_node import rules_by_node
from dvtcli.operations.network.check_live import LISTEN_S, against_file
from dvtcli.operations.network.check_networks import CheckOptions, chosen_rules, findings_of, judged_file
from dvtcli.operations.network.live_network import has_bus, listen, live_state, refuse_without_bus
from dvtcli.operations.network.network_load import USUAL_BIT_RATE
from dvtcli.operations.plans.read_network_config import read_network_config
from dvtcli.operations.results import Facts
from dvtcli.operations.results.networks import Measured, NetworkLoad, action, differing, parameter_texts
from dvtcli.operations.session.save_script import ask_before_overwriting, make_file, place_of
from dvtcli.operations.user.refused_options import refuse_options
from dvtcli.operations.values.object_values import scalings_of
from dvtcli.watch.statistics import FrameCount

if TYPE_CHECKING:
    from dvtcli.domain.frame import Field
    from dvtcli.domain.network.network_config import NetworkConfig
    from dvtcli.domain.network.network_plan import NodePlan
    from dvtcli.domain.network.network_state import Identifier, NetworkState, NodeState
    from dvtcli.domain.network.worst_case_load import StreamLoad
    from dvtcli.domain.object_scalings import ObjectScalings, Rules
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.domain.plan import ValueChange
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.results.checks import NetworkFinding
    from dvtcli.operations.results.networks import FrameLoad
    from dvtcli.operations.session.session import Session, SessionNodes
    from dvtcli.operations.user.session_user import SessionUser

SUFFIXES = (".html", ".htm", ".svg", ".dot", ".gv")


def draw_network(
    session: Session, target: str, file: str | None = None, options: PictureOptions | None = None
) -> Facts:
    """Draw the network of *file*, or of the bus, to *target*; asks before overwriting. Raises as `network_picture`.

    Raises UsageError for another suffix, or if *target* cannot be written.
    """
    path = place_of(target, "NAME.html")
    if path.suffix.lower() not in SUFFIXES:
        hint = Hint(Action.DRAW, why="{}, NAME.svg or NAME.dot")
        if file is not None and PurePath(file).suffix.lower() in SUFFIXES:  # they were given the other way round
            hint = Hint(Action.DRAW, {"file": file, "source": target}, "the page comes first: {}")
        raise UsageError(f"{target}: unknown format", hint=hint)
    picture = network_picture(session, file, options)
    data = drawn(picture, path)
    ask_before_overwriting(session, path)
    make_file(session, path, data)
    return _answer(target, picture, len(data))


def drawn(picture: NetworkPicture, path: PurePath) -> bytes:
    """Format *picture* by the suffix of *path*."""
    suffix = path.suffix.lower()
    if suffix == ".svg":
        from dvtcli.files.picture.wiring import alone, wiring

        return alone(wiring(picture))
    if suffix in (".dot", ".gv"):
        from dvtcli.files.picture.wiring import graphviz

        return graphviz(picture)
    from dvtcli.files.picture.page import page

    return page(picture)


def _answer(target: str, picture: NetworkPicture, size: int) -> Facts:
    on = sum(pdo.config.enabled for _, pdo in picture.pdos)
    differing = None if picture.differences is None else len(picture.differences)
    counts = [plural(len(picture.nodes), "node"), plural(on, "PDO"), plural(len(picture.links), "link")]
    counts += [plural(len(picture.findings), "finding")]
    counts += (
        [plural(differing, "difference") + f" to {picture.compared}"]
        if picture.compared and differing is not None
        else []
    )
    label = "error" if picture.exit_code else "note"
    text = [f"{target}: {picture.title}, {', '.join(counts)}", *(f"{label}: {note}" for note in picture.notes)]
    rows = (
        ("file", target), ("from", picture.source), ("compared_with", picture.compared or None),
        ("nodes", len(picture.nodes)), ("pdos", on), ("links", len(picture.links)),
        ("findings", len(picture.findings)), ("differences", differing if picture.compared else None),
        ("bytes", size), ("notes", list(picture.notes)),
    )  # fmt: skip
    failure = ended_with(picture.exit_code, "; ".join(picture.notes)) if picture.exit_code else None
    return Facts("report", rows, tuple(text), failure)


def drawn_links(state: NetworkState) -> Iterator[PictureLink]:
    """Yield every enabled RPDO with each TPDO of another node that it receives."""
    for connection in CheckedNetwork(state, None).received:
        producer, consumer = (
            Endpoint(connection.producer.node_id, connection.tpdo),
            Endpoint(connection.consumer.node_id, connection.rpdo),
        )
        cob_id = connection.sends.communication.cob_id
        fits = not _is_known(connection.sends, connection.takes) or agrees(
            connection.sends.mapping, connection.takes.mapping
        )
        yield PictureLink(producer, consumer, (cob_id.can_id, cob_id.extended), fits)


def _is_known(*configs: PdoConfig) -> bool:
    """Tell whether all mappings are known."""
    return all(config.has_mapping and config.mpdo is None for config in configs)


def drawn_nodes(state: NetworkState, said: Mapping[int, Rules]) -> Iterator[PictureNode]:
    """Yield every node with all PDOs, even disabled; *said* has rules by node-ID that override profiles and files."""
    partners: dict[Endpoint, list[Endpoint]] = {}
    for link in drawn_links(state):
        partners.setdefault(link.producer, []).append(link.consumer)
        partners.setdefault(link.consumer, []).append(link.producer)
    for node in state.nodes:
        scalings = scalings_of(node.profile, node.dictionary, [said.get(node.node_id, {})])
        pdos = (_pdo(node, pdo, config, scalings, partners) for pdo, config in sorted(node.pdos.items()))
        is_told = node.node_id not in state.undescribed
        yield PictureNode(node.node_id, node.name, node.title, tuple(_facts(node)), tuple(pdos), is_told)


def _pdo(
    node: NodeState, pdo: Pdo, config: PdoConfig, scalings: ObjectScalings, partners: dict[Endpoint, list[Endpoint]]
) -> PicturePdo:
    end = Endpoint(node.node_id, pdo)
    fields = tuple(_field(node, field, scalings) for field in layout(config.mapping))
    return PicturePdo(end, config, fields, tuple(partners.get(end, ())))


def _field(node: NodeState, one: Field, scalings: ObjectScalings) -> PictureField:
    entry = one.entry
    if entry.is_dummy:
        return PictureField(one.start_bit, one.bits, entry.object, is_dummy=True)
    described = node.dictionary.entry(entry.index, entry.sub_index) if node.dictionary else None
    name = node.dictionary.display_name(entry.index, entry.sub_index) if node.dictionary and described else ""
    kind = described.data_type.short if described and described.data_type else ""
    return PictureField(one.start_bit, one.bits, entry.object, name, kind, scalings.of(entry.index, entry.sub_index))


def _facts(node: NodeState) -> Iterator[tuple[str, str]]:
    """Yield a node's services: producers, and heartbeats consumed."""
    if node.heartbeat_ms:
        yield "heartbeat", f"every {node.heartbeat_ms} ms"
    elif node.is_guarded:
        yield "heartbeat", "none; it uses node guarding (0x100C, 0x100D)"
    if node.watched:
        yield (
            "watches",
            ", ".join(f"node {node_id} ({time_ms} ms)" for node_id, time_ms in sorted(node.watched.items())),
        )
    if node.produces_sync:
        yield "SYNC", f"every {(node.number(CYCLE_PERIOD) or 0) / 1000:g} ms"
    if node.emcy is not None:
        yield "EMCY", identifier_text(node.emcy)
    elif node.number(COB_ID_EMCY) is not None:
        yield "EMCY", "off"


def drawn_load(load: NetworkLoad) -> PictureLoad:
    """Summarise the load of all frames, computed and measured."""
    need, measured = load.need, load.measured
    received = measured.load(need.bit_rate) if measured is not None and measured.seconds else None
    return PictureLoad(
        need.bit_rate, need.limited, need.total, need.fits, load.is_assumed, load.fitting, need.assumed, received,
        0.0 if measured is None else measured.seconds,
    )  # fmt: skip


def drawn_frames(state: NetworkState, load: NetworkLoad) -> Iterator[PictureFrame]:
    """Yield every used CAN-ID with its frames by `load`, or RPDOs without a producer."""
    hearing = _hearing(state)
    found: dict[tuple[Identifier, int], PictureFrame] = {}
    for frame_load in load.frames:
        for number, need in enumerate(frame_load.needs or (None,)):
            found[frame_load.identifier, number] = _frame(
                load, frame_load, need, hearing.get(frame_load.identifier, ())
            )
    used = {identifier for identifier, _ in found}
    for node, pdo, config in state.enabled(is_tpdo=True):
        if (identifier := identifier_of(config)) not in used:
            frame = PictureFrame(identifier, pdo.label, node.node_id, (config.bits + 7) // 8, "on request (RTR)",
                                 is_computed=False, consumers=hearing.get(identifier, ()))  # fmt: skip
            found.setdefault((identifier, 0), frame)
    used = {identifier for identifier, _ in found}
    for identifier in hearing.keys() - used:
        why = "no node of the network transmits it"
        found[identifier, 0] = PictureFrame(
            identifier, "", None, 0, why, is_computed=False, consumers=hearing[identifier]
        )
    yield from (found[key] for key in sorted(found, key=_order))


def _order(key: tuple[Identifier, int]) -> tuple[int, bool, int, int]:
    """Sort by bus priority: lower CAN-ID first."""
    (can_id, extended), number = key
    return (can_id >> 18 if extended else can_id, extended, can_id, number)


def _hearing(state: NetworkState) -> dict[Identifier, tuple[Endpoint, ...]]:
    """Map CAN-IDs to the enabled RPDOs that receive them."""
    found: dict[Identifier, tuple[Endpoint, ...]] = {}
    for node, pdo, config in state.enabled(is_tpdo=False):
        identifier = identifier_of(config)
        found[identifier] = (*found.get(identifier, ()), Endpoint(node.node_id, pdo))
    return found


def _frame(load: NetworkLoad, one: FrameLoad, need: StreamLoad | None, consumers: tuple[Endpoint, ...]) -> PictureFrame:
    measured = load.measured if load.measured is not None and load.measured.seconds else None
    measured_hz = measured.rate_hz(one.identifier) if measured else None
    measured_share = measured.share(one.identifier, load.need.bit_rate) if measured else None
    if need is None:
        length = one.heard.data_bytes if one.heard else 0
        return PictureFrame(
            one.identifier, one.label, one.node, length, "only received", is_computed=False, consumers=consumers,
            measured_hz=measured_hz, measured_share=measured_share,
        )  # fmt: skip
    stream = need.stream
    hears = tuple(end for end in consumers if end.node_id != stream.node)
    return PictureFrame(
        one.identifier, stream.label, stream.node, stream.frame.data_bytes, stream.why,
        _fraction(stream.frame.period_us), need.share, need.response_us, _fraction(stream.deadline_us), need.is_late,
        True, hears, measured_hz, measured_share,
    )  # fmt: skip


def _fraction(time_us: Fraction | int | None) -> Fraction | None:
    return None if time_us is None else Fraction(time_us)


def differences(session: Session, file: str) -> Iterator[PictureDifference]:
    """List every parameter that differs from the network *file*; raises as `plan_network`."""
    from dvtcli.operations.plans.plan_network import plan_network

    for node in plan_network(session, file).nodes:
        for change in node.plan.changes:
            yield from _of_pdo(node, change) if isinstance(change, PdoChange) else _of_object(node, change)


def _of_pdo(node_plan: NodePlan, change: PdoChange) -> Iterator[PictureDifference]:
    if action(node_plan, change) == "prune":
        yield PictureDifference(node_plan.node_id, change.label, "enabled", "on", "off (not in the file)")
        return
    for key, was, will in differing(change):
        before, after = parameter_texts(change, key, was, will)
        yield PictureDifference(node_plan.node_id, change.label, key, before, after)


def _of_object(node_plan: NodePlan, change: ValueChange) -> Iterator[PictureDifference]:
    step = change.step
    was, will = step.text(step.before), step.text(step.after)
    yield PictureDifference(node_plan.node_id, f"0x{step.object}", "value", was, will)


#: what passed on the bus: counted for the load, and kept for the rules; None if nobody listened
_Received = tuple[Measured | None, ReceivedTraffic | None]


@dataclass(frozen=True, slots=True)
class PictureOptions:
    """Options of a picture: *title* (None: name of file or bus), *bit_rate* (bit/s).

    A bus is recorded for *for_s* seconds (None: 2, or not at all if nobody else can be on it).
    """

    title: str | None = None
    bit_rate: int | None = None
    for_s: float | None = None


def network_picture(session: Session, file: str | None = None, options: PictureOptions | None = None) -> NetworkPicture:
    """Collect the network of *file* without a bus; else of the nodes on the bus, compared with *file* if given.

    Raises as `described_network`; UsageError without file and bus, NoAnswer if no node can be read.
    """
    options = options or PictureOptions()
    if file is not None and not has_bus(session):
        refuse_options({"for_s": options.for_s or None}, "only with a bus, from which it receives")
        return _of_file(session, file, options)
    refuse_without_bus(session)
    return _of_bus(session, file, options)


def _of_file(session: SessionUser, file: str, options: PictureOptions) -> NetworkPicture:
    told, config = options.bit_rate or session.options.bitrate, read_network_config(file)
    state, found = judged_file(file, config, CheckOptions(bit_rate=told), reporter=session.reporter)
    return _picture(
        state, options.title or Path(file).stem, Path(file).name, told, found, said=rules_by_node(config.nodes)
    )


def _of_bus(session: Session, file: str | None, options: PictureOptions) -> NetworkPicture:
    config = None if file is None else read_network_config(file)
    received = _received(session, options)
    return session.read_together(lambda: _of_nodes(session, file, config, options, received))


def _of_nodes(
    session: Session, file: str | None, config: NetworkConfig | None, options: PictureOptions, received: _Received
) -> NetworkPicture:
    """Collect the nodes on the bus with received frames *received*, compared with *config* of *file*."""
    configured = () if config is None else config.nodes
    names = {node.node_id: node.name for node in configured}
    measured, traffic = received
    state = live_state(session, traffic, names)
    if not state.nodes:
        raise NoAnswer(
            f"no node answers on {session.wire.name}: nothing to draw",
            hint=Hint(
                Action.FIND_NODES,
                why="check that it is the right bus and that its nodes are on; {} tries every node-ID",
            ),
        )
    state = state._replace(nodes=tuple(replace(node, name=names.get(node.node_id, "")) for node in state.nodes))
    told = options.bit_rate or session.wire.bitrate or session.options.bitrate
    network = CheckedNetwork(state, told, traffic)
    found = list(findings_of(network, chosen_rules(CheckOptions())))
    title = options.title or (session.wire.name if file is None else Path(file).stem)
    picture = _picture(state, title, session.wire.name, told, found, measured, said=rules_by_node(configured))
    return picture if file is None or config is None else _compared(session, picture, state, file, config)


def _received(session: SessionNodes, options: PictureOptions) -> _Received:
    """Record the traffic on the bus: counted for the load, and kept for the rules."""
    simulated = session.wire.simulated
    for_s = options.for_s if options.for_s is not None else 0.0 if simulated else LISTEN_S
    count, traffic = FrameCount(), ReceivedTraffic()

    def take(frame: Frame, sent: bool) -> None:
        count.add(frame)
        if not sent:
            traffic.add(frame)

    received = listen(session, for_s, take)
    if not received.seconds:
        return None, None
    traffic.seconds, traffic.error_frames = received.seconds, received.error_frames
    return Measured(count, received.seconds, received.error_frames, received.lost_frames), traffic


def _compared(
    session: Session, picture: NetworkPicture, live: NetworkState, file: str, config: NetworkConfig
) -> NetworkPicture:
    """Add the differences by `diff`, or its error and exit code, to *picture* of the nodes *live*."""
    name = Path(file).name
    try:
        return replace(picture, compared=name, differences=tuple(differences(session, file)))
    except (RuleError, NoAnswer, SafetyRefusal) as refused:
        also = [text for label, text in refused.details if label == "also"]
        against = [_finding(finding) for finding in against_file(session, file, config, live)]
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
        worst_case_load(streams, bit_rate), fitting_bit_rates(streams), is_assumed=told is None, measured=measured
    )
    return NetworkPicture(
        title, source, tuple(drawn_nodes(state, said)), tuple(drawn_links(state)),
        tuple(drawn_frames(state, load)), drawn_load(load), tuple(map(_finding, found)),
    )  # fmt: skip


def _finding(one: NetworkFinding) -> PictureFinding:
    return PictureFinding(one.severity, one.rule, one.text, one.node, one.line if one.column else None)
