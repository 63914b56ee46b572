"""Check the nodes on a bus: their values, their traffic, and what files say about them. Writes nothing.

The rules are in `domain/network/check`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.check.check_bus import CHECKS_OF_BIT_RATE
from dvtcli.domain.network.check.checked_network import CheckedNetwork
from dvtcli.domain.network.network_state import NetworkState, NodeState
from dvtcli.domain.objects import BOOT_TIME, DEVICE_TYPE, IDENTITY, NMT_STARTUP
from dvtcli.domain.text import plural
from dvtcli.errors import DvtcliError, InputFileError, NoAnswer, RuleError, SdoAborted, SdoProtocolError, UsageError
from dvtcli.operations.network.check_networks import (
    CheckOptions,
    check_networks,
    chosen_rules,
    findings_of,
)
from dvtcli.operations.network.described_network import DeviceWord, described_network, simulated_word
from dvtcli.operations.network.described_nodes import described_nodes
from dvtcli.operations.network.live_network import live_state, received_traffic, refuse_without_bus
from dvtcli.operations.plans.identify_nodes import identify_nodes, is_wanted
from dvtcli.operations.plans.read_network_config import read_network_config
from dvtcli.operations.results.checks import NetworkFinding, NetworkReport, NetworksChecked, asked_rules, judged_rules
from dvtcli.simulator.network.family_file import family_of
from dvtcli.watch.decoder import Decoder
from dvtcli.watch.recording_checks.frame_problems import DEFAULT_LENGTH, LENGTH, NOT_SENT
from dvtcli.watch.recording_checks.recording_rules import RecordingCheck
from dvtcli.watch.recording_checks.stream_problems import LOAD

if TYPE_CHECKING:
    from dvtcli.domain.lint import LintRule
    from dvtcli.domain.network.network_config import NetworkConfig, NodeConfig
    from dvtcli.domain.network.received_traffic import ReceivedTraffic
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.session.session import SessionNodes

#: How long a bus is listened to: most heartbeats come once a second or faster, SYNC much faster.
LISTEN_S = 2.0
#: rules about recordings that need what a file says of the PDOs
_NEED_A_FILE = {
    **dict.fromkeys(
        (LENGTH.name, DEFAULT_LENGTH.name), "rule other-length replaces it there, with the mappings of the nodes"
    ),
    NOT_SENT.name: "the expected RPDOs are unknown; check a recording with a network file",
}
#: Identification and NMT settings of a node, which no file decides.
_OF_ITSELF = {IDENTITY, DEVICE_TYPE, *range(NMT_STARTUP, BOOT_TIME + 1)}


def check_all(session: SessionNodes, files: Sequence[str], options: CheckOptions) -> NetworksChecked:
    """Check each of *files* and the nodes on the bus, and compare both.

    The bus's bit rate counts for the files, too, and nodes without an EDS in a file are described by the bus. A finding
    of a file is not repeated for the bus.
    """
    if not files:
        return check_live(session, options)
    refuse_without_bus(session)
    options = replace(options, bit_rate=_bit_rate(session, options))
    on_bus = {file: words_on_bus(session, file, config) for file in files if (config := _read(file)) is not None}
    of_files = check_networks(files, options, on_bus).reports
    of_bus, *against = check_live(session, options, files, on_bus).reports
    return NetworksChecked((*of_files, _not_said(of_bus, of_files), *against))


def _read(file: str) -> NetworkConfig | None:
    try:
        return read_network_config(file)
    except (InputFileError, UsageError):
        return None  # its own report says so


def _bit_rate(session: SessionNodes, options: CheckOptions) -> int | None:
    return options.bit_rate or session.wire.bitrate or session.options.bitrate


def _not_said(of_bus: NetworkReport, of_files: Sequence[NetworkReport]) -> NetworkReport:
    """Return *of_bus* without findings repeated in *of_files*, and with their number."""
    said = {(finding.rule, finding.text) for report in of_files for finding in report.findings}
    new = tuple(finding for finding in of_bus.findings if (finding.rule, finding.text) not in said)
    return replace(of_bus, findings=new, said=len(of_bus.findings) - len(new))


def check_live(
    session: SessionNodes,
    options: CheckOptions | None = None,
    files: Sequence[str] = (),
    on_bus: Mapping[str, Mapping[int, DeviceWord]] | None = None,
) -> NetworksChecked:
    """Check all nodes on the bus that are known, transmit or answer; compare *files* with them.

    Returns a report of the bus and a report per file: whether its nodes are present and match, and whether a manager on
    the bus expects or downloads something else. An unreadable file is left out; *on_bus* has descriptions of nodes by
    file. Raises UsageError without a bus or for an unknown rule; NoAnswer if no node could be read.
    """
    options = options or CheckOptions()
    rules = chosen_rules(options)
    refuse_without_bus(session)
    bit_rate = _bit_rate(session, options)
    rules = _judged(rules, options, bit_rate)
    told = on_bus or {}
    networks = {
        file: state for file in dict.fromkeys(files) if (state := _described(file, told.get(file, {}))) is not None
    }
    recorded = _Recorded(session, options) if options.for_s else None
    traffic = received_traffic(session, _seconds(session, options), None if recorded is None else recorded.take)
    ids = {node.node_id for network in networks.values() for node in network.nodes}
    live, bus = live_state(session, traffic, ids), session.wire
    if not live.nodes:
        raise _nobody(bus.name, traffic)
    of_bus = NetworkReport(
        bus.name,
        asked_rules(rules),
        tuple(
            replace(finding, line=0)
            for finding in _with_problems(findings_of(CheckedNetwork(live, bit_rate, traffic), rules), recorded, rules)
        ),
        tuple((node.title, node.node_id, len(node.pdos)) for node in live.nodes),
        is_live=True,
        strict=options.strict,
        heard=_received(traffic),
    )
    against = [_against(file, state, live, options, bit_rate) for file, state in networks.items()]
    return NetworksChecked((of_bus, *(replace(report, bus=bus.name) for report in against if report.rules)))


def _judged(rules: Sequence[LintRule], options: CheckOptions, bit_rate: int | None) -> tuple[LintRule, ...]:
    """Return *rules* without those that need the bit rate or a file, if these are unknown.

    Raises UsageError if *options* name one of these, or if no rule is left.
    """
    rules = judged_rules(rules, options.only, {LOAD.name, *CHECKS_OF_BIT_RATE}, bit_rate)
    judged = tuple(rule for rule in rules if rule.name not in _NEED_A_FILE)
    for rule in rules:
        if rule.name in _NEED_A_FILE and (rule.name in options.only or not judged):
            raise UsageError(
                f"rule {rule.name} is not judged on a running bus: {_NEED_A_FILE[rule.name]}",
                hint="leave this rule out",
            )
    return judged


class _Recorded:
    """The frames that are heard, judged as those of a recording."""

    def __init__(self, session: SessionNodes, options: CheckOptions) -> None:
        described = described_nodes(session)

        def name_of(node_id: int, index: int, sub_index: int) -> str:
            return described(node_id).value(index, sub_index, None).name

        self._check = RecordingCheck(Decoder().layout, name_of, bit_rate=_bit_rate(session, options))
        self._count, self._begin_s = 0, 0.0

    def take(self, frame: Frame) -> None:
        """Look at the next *frame*."""
        self._count += 1
        if self._count == 1:
            self._begin_s = frame.timestamp_s
        self._check.take(self._count, frame)

    def findings(self, names: Collection[str]) -> Iterator[NetworkFinding]:
        """Yield the problems of the rules *names*, the worst first, with their times from the first frame."""
        for problem in sorted(self._check.problems(), key=lambda problem: problem.order):
            if problem.rule.name in names:
                moments = problem.moments
                when = f"at {moments.first.time_s - self._begin_s:.1f} s"
                if moments.times > 1:
                    when = f"{moments.times} times, {when} to {moments.last.time_s - self._begin_s:.1f} s"
                yield NetworkFinding(
                    1, str(problem.rule.severity), problem.rule.name, problem.object,
                    f"{problem.text} ({when}); check first: {problem.look}", node=problem.node,
                )  # fmt: skip


#: rules of networks that say less than those about recordings
_SAYS_MORE = {
    "restarts": ("boot-up-in-operation",), "emergency": ("emergency-not-reset", "emergency-reset"),
}  # fmt: skip


def _with_problems(
    found: Iterable[NetworkFinding], recorded: _Recorded | None, rules: Sequence[LintRule]
) -> tuple[NetworkFinding, ...]:
    """Return the findings *found* and those of what was *recorded*, if anything, each problem once."""
    problems = () if recorded is None else tuple(recorded.findings({rule.name for rule in rules}))
    said = {(problem.rule, problem.node) for problem in problems}
    kept = (
        finding for finding in found
        if not any((name, finding.node) in said for name in _SAYS_MORE.get(finding.rule, ()))
    )  # fmt: skip
    return (*kept, *problems)


def _nobody(name: str, traffic: ReceivedTraffic | None) -> NoAnswer:
    frames = 0 if traffic is None else traffic.frames
    return NoAnswer(
        f"no node answers on {name}: nothing was checked",
        why=f"{plural(frames, 'frame')} heard",
        hint=Hint(
            Action.FIND_NODES, why="check that it is the right bus and that its nodes are on; {} tries every node-ID"
        )
        + Hint(Action.LISTEN_BIT_RATE, why="listens"),
    )


def _seconds(session: SessionNodes, options: CheckOptions) -> float:
    if options.for_s is not None:
        return options.for_s
    return 0.0 if session.wire.simulated else LISTEN_S


def _received(traffic: ReceivedTraffic | None) -> tuple[float, int] | None:
    return None if traffic is None else (traffic.seconds, traffic.frames)


def _described(file: str, on_bus: Mapping[int, DeviceWord]) -> NetworkState | None:
    """Build the state that *file* describes, without links that cannot be made; None if there is none."""
    try:
        return described_network(file, for_rules=True, on_bus=on_bus)
    except (RuleError, UsageError):
        pass
    except InputFileError:
        return None
    try:
        return described_network(file, for_rules=True, with_links=False, on_bus=on_bus)
    except DvtcliError:
        return None


def against_file(
    session: SessionNodes, file: str, config: NetworkConfig, live: NetworkState
) -> tuple[NetworkFinding, ...]:
    """Report nodes of *config* (from *file*) that are missing or different in *live*, the state of the bus."""
    options = CheckOptions()
    state = _described(file, words_on_bus(session, file, config))
    return () if state is None else _against(file, state, live, options, _bit_rate(session, options)).findings


def _against(
    file: str, state: NetworkState, live: NetworkState, options: CheckOptions, bit_rate: int | None
) -> NetworkReport:
    """Report contradictions between *state* of *file* and the nodes on the bus."""
    from dvtcli.domain.network.check.network_rules import AGAINST_FILE

    names = {rule.name for rule in chosen_rules(options)}
    rules = [rule for rule in AGAINST_FILE if rule.name in names]
    there = frozenset(node.node_id for node in live.nodes)
    network = CheckedNetwork(_with_live(state, live), bit_rate or state.bit_rate, present=there)
    findings = tuple(findings_of(network, rules))
    nodes = tuple((node.name, node.node_id, len(node.marks)) for node in state.nodes)
    return NetworkReport(file, asked_rules(rules), findings, nodes, is_live=True, strict=options.strict)


def _with_live(state: NetworkState, live: NetworkState) -> NetworkState:
    """Add to *state* the identities of live nodes, and the managers on the bus."""
    nodes = [_one_with_live(node, live.node(node.node_id)) for node in state.nodes]
    managers = [node for node in live.nodes if state.node(node.node_id) is None and node.number(NMT_STARTUP)]
    ordered = sorted([*nodes, *managers], key=lambda live_node: live_node.node_id)
    return state._replace(nodes=tuple(ordered), undescribed=())


def _one_with_live(node: NodeState, live: NodeState | None) -> NodeState:
    kept = {place: value for place, value in node.numbers.items() if place[0] not in _OF_ITSELF}
    if live is None:
        return replace(node, numbers=kept)
    said = {place: value for place, value in live.numbers.items() if place[0] in _OF_ITSELF}
    return replace(node, numbers={**kept, **said}, downloads=live.downloads)


def words_on_bus(session: SessionNodes, file: str, config: NetworkConfig) -> dict[int, DeviceWord]:
    """Return what describes each node of *config* whose EDS only its identity tells.

    Silent nodes and other devices than in the file are left out.
    """
    found: dict[int, DeviceWord] = {}
    for node in _undescribed(file, config):
        with suppress(NoAnswer, SdoAborted, SdoProtocolError):
            if is_wanted(session.network.node(node.node_id), node.identity):
                found |= _word(session, node.node_id)
    return found


def words_of_present(session: SessionNodes, file: str, config: NetworkConfig) -> dict[int, DeviceWord]:
    """Return what describes the nodes as `words_on_bus`, but raise for a silent node or another device, as a plan does.

    A node without a word has no EDS, rather than no power.
    """
    with session.network.as_it_was_if_refused():
        met = identify_nodes(session, file, replace(config, nodes=tuple(_undescribed(file, config)), links=()))
        met.end()
    return {node_id: word for node in met.nodes for node_id, word in _word(session, node).items()}


def _undescribed(file: str, config: NetworkConfig) -> list[NodeConfig]:
    return [node for node in config.nodes if simulated_word(file, node) is None]


def _word(session: SessionNodes, node_id: int) -> dict[int, DeviceWord]:
    files = session.network.files
    path = files.eds_path(node_id)
    return (
        {} if path is None else {node_id: DeviceWord(family_of(path) or str(path), files.modules(node_id, path) or ())}
    )
