"""Check recordings: what went wrong on the bus, when, and between whom."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.network_state import identifier_of
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.device_file import DEVICE_SUFFIXES
from dvtcli.files.recordings.formats import NETWORK_FILE, is_recording, other_format
from dvtcli.files.recordings.recording_file import check_readable, read_recorded
from dvtcli.operations.frames.recorded import decoder_for, standard_input
from dvtcli.operations.network.described_nodes import described_nodes, network_config_of
from dvtcli.operations.results.checks import (
    RecordingFinding,
    RecordingReport,
    RecordingsChecked,
    asked_rules,
    judged_rules,
    rules_among,
)
from dvtcli.watch.recording_checks.problems import Problem
from dvtcli.watch.recording_checks.recording_rules import RECORDING_RULES, UNREADABLE, RecordingCheck
from dvtcli.watch.recording_checks.stream_problems import LOAD

if TYPE_CHECKING:
    from dvtcli.domain.lint import LintRule
    from dvtcli.domain.network.network_config import NetworkConfig
    from dvtcli.domain.pdo import PdoCommunicationParameter
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.watch.decoder import Address, Decoder
    from dvtcli.watch.known_node import KnownNode
    from dvtcli.watch.recording_checks.frame_problems import NodePdo

#: standard input
STDIN = "-"


def are_recordings(files: Sequence[str]) -> bool:
    """Tell by suffixes and content whether *files* are recordings, as `-` is.

    Raises UsageError if only some are, or if a file is of another known format.
    """
    recordings = [file for file in files if file == STDIN or is_recording(Path(file))]
    for file in files if not recordings else ():
        other = other_format(Path(file)) or (_DEVICE_FILE if _is_device_file(file) else "")
        if other not in ("", NETWORK_FILE):
            raise UsageError(
                f"{file} is neither a recording nor a network file: it is {other}",
                hint=_checked_otherwise(file),
            )
    if recordings and len(recordings) < len(files):
        raise UsageError(
            f"{recordings[0]} is a recording, and others are not",
            hint=Hint(Action.CHECK, {"file": recordings[0]}, "{} checks it; the others by a check of their own"),
        )
    return bool(recordings)


_DEVICE_FILE = "an EDS, DCF, XDD or XDC file"


def _is_device_file(file: str) -> bool:
    return Path(file).suffix.lower() in DEVICE_SUFFIXES and Path(file).is_file()


def _checked_otherwise(file: str) -> Hint | str:
    """How to check *file*, neither a recording nor a network file."""
    if _is_device_file(file):
        return Hint(Action.CHECK_EDS, {"file": file})
    return "a network file is YAML; recordings are what dvtcli's log, candump and other tools write"


@dataclass(frozen=True, slots=True)
class RecordingOptions:
    """Options of `check` for recordings: rules by name (*only*, empty: all; except *without*).

    *dbc* is a DBC or network file that describes the frames; *bit_rate* (bit/s) is the bus's, None: that of the network
    file. *as_findings* turns read errors of a single recording into findings.
    """

    dbc: str | None = None
    only: Collection[str] = ()
    without: Collection[str] = ()
    bit_rate: int | None = None
    as_findings: bool = False


def check_recordings(session: SessionNodes, files: Sequence[str], options: RecordingOptions) -> RecordingsChecked:
    """Check each recording in *files*; `-` is standard input.

    Read errors are findings if there are several files; a single one raises UsageError if it is missing, InputFileError
    if it is damaged. Raises UsageError for an unknown rule.
    """
    rules = rules_among(
        (*RECORDING_RULES, UNREADABLE), options.only, options.without, "recordings",
        "docs/reference/recording-rules.md",
    )  # fmt: skip
    known = _known(session, options)
    judged = judged_rules(rules, options.only, (LOAD.name,), known.bit_rate)
    names = tuple(dict.fromkeys(files))
    report = _report if len(names) == 1 and not options.as_findings else _report_anyway
    return RecordingsChecked(tuple(report(session, file, known, judged) for file in names))


@dataclass(frozen=True, slots=True)
class _Known:
    """What is known of the nodes before a recording is read; *decoder* is None if each recording says it itself."""

    decoder: Decoder | None
    described: Callable[[int], KnownNode]
    rpdos: Mapping[NodePdo, Address]
    tpdos: Mapping[NodePdo, PdoCommunicationParameter]
    bit_rate: int | None
    #: node-IDs in the network file
    node_ids: tuple[int, ...] = ()


def _known(session: SessionNodes, options: RecordingOptions) -> _Known:
    dbc, config = options.dbc, network_config_of(options.dbc)
    rpdos, tpdos, bit_rate = ({}, {}, None) if dbc is None or config is None else _of_network(dbc, config)
    return _Known(
        None if dbc is None else decoder_for(session, None, dbc, config=config),
        described_nodes(session, dbc, config), rpdos, tpdos, options.bit_rate or bit_rate,
        () if config is None else tuple(sorted(node.node_id for node in config.nodes)),
    )  # fmt: skip


def _report_anyway(session: SessionNodes, file: str, known: _Known, rules: tuple[LintRule, ...]) -> RecordingReport:
    """Report on *file*, with a read error as a finding."""
    try:
        return _report(session, file, known, rules)
    except (InputFileError, UsageError) as failed:
        place = failed.place or file
        line = place.rpartition(":")[2]
        text = failed.text.removeprefix(f"{place}: ").removeprefix(f"{file}: ")
        finding = RecordingFinding(
            int(line) if line.isdecimal() else 1, "error", UNREADABLE.name, "",
            f"{text}: {failed.why}" if failed.why else text,
        )  # fmt: skip
        return RecordingReport(file, asked_rules((UNREADABLE,)), (finding,), unread=failed.exit_code)


def _report(session: SessionNodes, file: str, known: _Known, rules: tuple[LintRule, ...]) -> RecordingReport:
    """Report on *file*; raises UsageError or InputFileError if it cannot be read."""
    with standard_input(file) as path:
        check_readable(path)
        return _report_of(session, file, path, known, rules)


def _report_of(
    session: SessionNodes, file: str, path: Path, known: _Known, rules: tuple[LintRule, ...]
) -> RecordingReport:
    decoder = decoder_for(session, None, None, path) if known.decoder is None else known.decoder

    def name_of(node_id: int, index: int, sub_index: int) -> str:
        return known.described(node_id).value(index, sub_index, None)[0]

    checks: dict[str, RecordingCheck] = {}
    number, first_s, last_s = 0, 0.0, 0.0
    for number, recorded in enumerate(read_recorded(path), 1):
        if number == 1:
            first_s = recorded.frame.timestamp_s
        last_s = recorded.frame.timestamp_s
        if (check := checks.get(recorded.channel)) is None:
            check = RecordingCheck(decoder.layout, name_of, known.rpdos, known.bit_rate, known.tpdos)
            checks[recorded.channel] = check
        if recorded.error:
            check.take_error(number, last_s)
        else:
            check.take(number, recorded.frame)
    if number > 1 and first_s == last_s:
        session.reporter.note(
            f"the frames of {path.name} have no times: delays, periods, missing frames and the load were not checked"
        )
    names = {rule.name for rule in rules}
    found = [
        (problem, bus if len(checks) > 1 else "")
        for bus, check in checks.items()
        for problem in check.problems()
        if problem.rule.name in names
    ]
    found.sort(key=lambda each: each[0].order)
    findings = tuple(_finding(problem, bus) for problem, bus in found)
    unseen = tuple(
        node_id for node_id in known.node_ids if not any(check.has_sent(node_id) for check in checks.values())
    )
    return RecordingReport(
        file, asked_rules(rules), findings, number, first_s, last_s, unseen=unseen,
        described=len(known.node_ids),
    )  # fmt: skip


def _of_network(
    file: str, network_config: NetworkConfig
) -> tuple[dict[NodePdo, Address], dict[NodePdo, PdoCommunicationParameter], int | None]:
    """Return the enabled RPDOs and TPDOs that the network *file*, read as *network_config*, names, and its bit rate."""
    from dvtcli.operations.network.described_network import described_pdos

    named = {(node.node_id, pdo.pdo) for node in network_config.nodes for pdo in node.pdos}
    rpdos: dict[NodePdo, Address] = {}
    tpdos: dict[NodePdo, PdoCommunicationParameter] = {}
    for node in described_pdos(file, network_config).nodes:
        for pdo, config in node.pdos.items():
            is_meant = (node.node_id, pdo) in named or pdo not in node.guessed
            if not config.enabled or not is_meant:
                continue
            if pdo.is_tpdo:
                tpdos[node.node_id, pdo] = config.communication
            else:
                rpdos[node.node_id, pdo] = identifier_of(config)
    return rpdos, tpdos, network_config.master.bit_rate if network_config.master is not None else None


def _finding(problem: Problem, bus: str) -> RecordingFinding:
    moments = problem.moments
    return RecordingFinding(
        moments.first.number, str(problem.rule.severity), problem.rule.name, problem.object, problem.text,
        parties=problem.parties, look=problem.look, first_s=moments.first.time_s, last_s=moments.last.time_s,
        times=moments.times, frames=tuple(moments.numbers), node=problem.node, bus=bus,
    )  # fmt: skip
