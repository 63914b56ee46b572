"""Check network files without any node. Writes nothing.

The rules are in `domain/network/check`, and those of `map` and `link`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dvtcli.domain.lint import ERROR, LintRule
from dvtcli.domain.network.network_config import NOWHERE, FileNote, Mark
from dvtcli.errors import DvtcliError, InputFileError, UsageError
from dvtcli.operations.network.described_network import described_network, library_match, unknown_names
from dvtcli.operations.plans.read_network_config import eds_of, read_network_config, skipped_rules
from dvtcli.operations.results.checks import (
    NetworkFinding,
    NetworkReport,
    NetworksChecked,
    asked_rules,
    judged_rules,
    rules_among,
)

if TYPE_CHECKING:
    from pathlib import Path

    from dvtcli.domain.network.check.checked_network import CheckedNetwork, NetSpot
    from dvtcli.domain.network.network_config import Mark, NetworkConfig
    from dvtcli.domain.network.network_state import NetworkState
    from dvtcli.domain.rules.finding import FileComplaint, Finding, Rule
    from dvtcli.files.network.file_log import FileLog
    from dvtcli.operations.network.described_network import DeviceWord
    from dvtcli.operations.user.session_user import Reporter


#: Rules about files instead of states.
FILE_RULES = (
    LintRule("network-file", ERROR,
             "the file cannot be read, contradicts itself, or has values that its nodes cannot have",
             "the network file's keys; the nodes' dictionaries"),
    LintRule("cannot-be-made", ERROR, "the configuration in the file is not possible on its nodes",
             "the rules of `map` and `link`"),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class CheckOptions:
    """Options of `check`: rules by name (*only*, empty: all; except *without*).

    *strict* treats warnings as errors; *bit_rate* (bit/s) is that of the bus, None for the file's. *as_findings* turns
    read errors of a file into findings. The bus is recorded for *for_s* seconds (None: `LISTEN_S`, or not at all if
    nobody else can be on it). *shows_all* lists warnings and notes about PDOs that the file does not name, instead of
    counting them.
    """

    only: Collection[str] = ()
    without: Collection[str] = ()
    strict: bool = False
    bit_rate: int | None = None
    as_findings: bool = False
    for_s: float | None = None
    shows_all: bool = False


def check_networks(
    files: Sequence[str],
    options: CheckOptions | None = None,
    on_bus: Mapping[str, Mapping[int, DeviceWord]] | None = None,
) -> NetworksChecked:
    """Check each of *files*; *on_bus* has descriptions of other nodes by file and node-ID.

    Read errors are findings if there are several files; for a single file they raise InputFileError with all its
    errors, or UsageError if it does not exist. Raises UsageError for an unknown rule.
    """
    options = options or CheckOptions()
    of_bus = {rule.name for rule in traffic_rules()} if options.for_s else set()
    rules = tuple(rule for rule in chosen_rules(options) if rule.name not in of_bus)
    names = tuple(dict.fromkeys(files))
    report = _report if len(names) == 1 and not options.as_findings else _report_anyway
    told = on_bus or {}
    return NetworksChecked(tuple(report(file, options, rules, told.get(file, {})) for file in names))


def chosen_rules(options: CheckOptions) -> tuple[LintRule, ...]:
    """Return the rules that *options* name; raises UsageError for an unknown rule, or if none is left.

    With a time to listen, those about recordings are among them.
    """
    from dvtcli.domain.network.check.network_rules import NETWORK_RULES

    rules = [*change_rules(), *FILE_RULES, *NETWORK_RULES]
    if options.for_s:
        rules += traffic_rules()
    return rules_among(rules, options.only, options.without, "networks", "docs/reference/network-rules.md")


def traffic_rules() -> tuple[LintRule, ...]:
    """List the rules about recordings that are asked of a bus; error frames have a rule of networks."""
    from dvtcli.watch.recording_checks.recording_rules import ERROR_FRAMES, RECORDING_RULES

    return tuple(rule for rule in RECORDING_RULES if rule is not ERROR_FRAMES)


def change_rules() -> tuple[LintRule, ...]:
    """List the rules of a change (`map`, `link`, `apply`), as asked of a file, with their worst severity."""
    return tuple(LintRule(rule.name, rule.severities[0], rule.sense, rule.source) for rule in rules_of_changes())


def rules_of_changes() -> tuple[Rule, ...]:
    """List the rules of a change (`map`, `link`, `apply`) that a file can break."""
    from dvtcli.device import virtual_pdos
    from dvtcli.domain.network import consumers, links
    from dvtcli.domain.rules import can_id, communication, mapped_object, no_way_back, pdo_mapping, raw_write
    from dvtcli.operations.changes import possible_stores
    from dvtcli.operations.plans import plan_network, read_network_config, resolve_links, resolve_names

    files = (
        can_id, communication, pdo_mapping, mapped_object, no_way_back, raw_write, virtual_pdos, consumers, links,
        possible_stores, resolve_names, resolve_links, read_network_config, plan_network,
    )  # fmt: skip
    return tuple(rule for file in files for rule in file.RULES)


def _report(
    file: str, options: CheckOptions, rules: tuple[LintRule, ...], on_bus: Mapping[int, DeviceWord]
) -> NetworkReport:
    """Report on *file*; raises InputFileError or UsageError if it cannot be read."""
    from dvtcli.domain.network.check.check_bus import CHECKS_OF_BIT_RATE

    try:
        config = read_network_config(file)
    except InputFileError as wrong:
        wrong.outcome = ""  # nothing was to be sent
        raise
    state, findings = judged_file(file, config, options, on_bus)
    judged = judged_rules(rules, options.only, CHECKS_OF_BIT_RATE, options.bit_rate or state.bit_rate)
    nodes = tuple((node.name, node.node_id, len(node.pdos)) for node in config.nodes)
    shown = tuple(finding for finding in findings if options.shows_all or not finding.is_aside)
    notes = tuple(
        (note.mark.line, note.mark.column, note.times, note.text)
        for note in (
            *config.notes,
            *unknown_names(file, config, on_bus),
            *_described(file, config),
            *_cut_short(file, config),
            *_undescribed(state),
        )
    )
    return NetworkReport(
        file, asked_rules(judged), shown, nodes, len(config.links), notes, strict=options.strict,
        folded=len(findings) - len(shown),
    )  # fmt: skip


def _described(file: str, config: NetworkConfig) -> Iterator[FileNote]:
    """Note each node described by a library file that may not match exactly."""
    for node in config.nodes:
        found = library_match(file, node)
        if found is not None and (remark := found.remark("in `identity:`")):
            yield FileNote(f"node {node.node_id}: {remark}", node.mark)


def _cut_short(file: str, config: NetworkConfig) -> Iterator[FileNote]:
    """Note each device file that ends in the middle, at the first node that names it: rules miss what it lacks."""
    from dvtcli.files.device_file import lacks_to_its_end, read_device_file

    marks: dict[Path, Mark] = {}
    for node in config.nodes:
        if node.dcf is not None and (path := eds_of(file, node)) is not None:
            marks.setdefault(path, node.dcf.mark)
    for path, mark in marks.items():
        if lacks := lacks_to_its_end(read_device_file(path)):
            yield FileNote(
                f"{path.name} is cut short: {lacks}; findings may be about these: get the complete file", mark
            )


def _undescribed(state: NetworkState) -> Iterator[FileNote]:
    """Note the nodes of *state* without a description, if any."""
    if state.undescribed:
        marks = [node.mark for node in state.nodes if node.node_id in state.undescribed]
        yield FileNote(skipped_rules(state.undescribed), min(marks, default=NOWHERE))


def _report_anyway(
    file: str, options: CheckOptions, rules: tuple[LintRule, ...], on_bus: Mapping[int, DeviceWord]
) -> NetworkReport:
    """Report on *file*, with read errors as findings."""
    try:
        return _report(file, options, rules, on_bus)
    except (InputFileError, UsageError) as failed:
        found = tuple(_unreadable(failed, file))
        return NetworkReport(file, asked_rules(FILE_RULES[:1]), found, strict=options.strict, unread=failed.exit_code)


def _unreadable(failed: DvtcliError, file: str) -> Iterator[NetworkFinding]:
    name, complaints = FILE_RULES[0].name, getattr(failed, "complaints", ())
    if not complaints:
        text = failed.text.removeprefix(f"{file}: ")
        yield NetworkFinding(1, "error", name, "", f"{text}: {failed.why}" if failed.why else text)
    yield from (replace(_at(complaint, name), complaint=complaint) for complaint in complaints)


def _at(one: FileComplaint, rule: str) -> NetworkFinding:
    """Turn a file complaint into a finding of *rule*."""
    return NetworkFinding(one.line, "error", rule, "", one.text, one.column, one.column + max(one.width, 1) - 1)


def judged_file(
    file: str,
    config: NetworkConfig,
    options: CheckOptions,
    on_bus: Mapping[int, DeviceWord] | None = None,
    reporter: Reporter | None = None,
) -> tuple[NetworkState, tuple[NetworkFinding, ...]]:
    """Simulate the network of *config* (from *file*) and apply the rules of changes and of networks.

    Parts that cannot be made become findings; the state has the rest.
    """
    from dvtcli.domain.network.check.checked_network import CheckedNetwork
    from dvtcli.files.network.file_log import FileLog
    from dvtcli.files.network.read_network import network_text

    rules, failures, log = chosen_rules(options), list[DvtcliError](), FileLog(file, network_text(file))
    state = described_network(file, reporter, for_rules=True, on_bus=on_bus, config=config, failures=failures)
    state = state._replace(links=()) if failures else state
    names = {rule.name for rule in rules}
    found = [finding for failed in failures for finding in _refused(config, failed, names)]
    found += (_of_change(state, node.node_id, said) for node in state.nodes for said in node.said if said.rule in names)
    found += _nothing_asked(config, state, names)
    network = CheckedNetwork(state, options.bit_rate or state.bit_rate)
    unread = _unread_pdos(config, failures)
    of_rules = (
        finding for finding in findings_of(network, rules)
        if finding.severity == "error" or (finding.node, finding.pdo) not in unread
    )  # fmt: skip
    return state, tuple(_shown(repeat, log) for repeat in without_repeats(found, of_rules))


def _unread_pdos(config: NetworkConfig, failures: Iterable[DvtcliError]) -> set[tuple[int | None, str | None]]:
    """List the PDOs whose request in the file cannot be read, by node-ID: what they will be is unknown."""
    wrong = {
        (complaint.line, complaint.column) for failed in failures for complaint in getattr(failed, "complaints", ())
    }
    return {
        (node.node_id, str(pdo.pdo))
        for node in config.nodes
        for pdo in node.pdos
        for mark in (*pdo.keys.values(), *(word.mark for word in pdo.mapping or ()))
        if (mark.line, mark.column) in wrong
    }


def _shown(found: NetworkFinding, log: FileLog) -> NetworkFinding:
    """Add to *found* its line in the file, if it has a place there."""
    if found.complaint is not None or not found.column:
        return found
    mark = Mark(found.line, found.column, found.end_column - found.column + 1)
    return replace(found, complaint=log.shown(mark, found.text))


def _nothing_asked(config: NetworkConfig, state: NetworkState, names: Collection[str]) -> Iterator[NetworkFinding]:
    """Warn about each node without configuration and description: no plan covers it."""
    from dvtcli.domain.rules.finding import warning
    from dvtcli.operations.plans.plan_network import ASKS_NOTHING

    for node_id in config.asked_nothing if "asked-nothing" in names else ():
        if node_id in state.undescribed:
            yield _of_change(state, node_id, warning("asked-nothing", "", ASKS_NOTHING))


def _refused(config: NetworkConfig, refused: DvtcliError, names: Collection[str]) -> Iterator[NetworkFinding]:
    """Yield each refusal at its place in the file, else at its node.

    The rule is that of the refusal; a refusal without a rule of changes gets the rule for parts that cannot be made.
    """
    from dvtcli.operations.plans.judge_network import in_keys

    if isinstance(refused, InputFileError) and refused.complaints:
        yield from (
            replace(_at(complaint, FILE_RULES[0].name), complaint=complaint) for complaint in refused.complaints
        )
        return
    for said in getattr(refused, "findings", ()) or ():
        rule = said.rule if said.rule in names else FILE_RULES[1].name
        mark = config.mark_of(refused.node, said.place) if said.complaint is None else _mark_of(said.complaint)
        if rule in names:
            hint = in_keys(said.hint)
            yield replace(_finding(rule, str(said.severity), refused.node, None, "", said.text, mark), hint=hint)
    if not getattr(refused, "findings", ()) and FILE_RULES[1].name in names:
        mark = config.mark_of(refused.node, "")
        hint = in_keys(refused.hint)
        yield replace(_finding(FILE_RULES[1].name, "error", refused.node, None, "", refused.text, mark), hint=hint)


def _mark_of(complaint: FileComplaint) -> Mark:
    return Mark(complaint.line, complaint.column, complaint.width)


def _of_change(state: NetworkState, node_id: int, said: Finding) -> NetworkFinding:
    """Place the finding of a rule of changes in the file."""
    from dvtcli.domain.network.check.checked_network import NetSpot, mark_of
    from dvtcli.operations.plans.judge_network import in_keys

    place = said.place.removeprefix("0x").partition(":")
    index = int(place[0], 16) if said.place.startswith("0x") else None
    sub_index = int(place[2], 16) if place[2] and index is not None else 0
    spot = NetSpot(node_id, said.pdo, index, sub_index)
    mark = mark_of(state, spot) if said.complaint is None else _mark_of(said.complaint)
    aside = _is_aside(state, spot)
    found = _finding(said.rule, str(said.severity), node_id, spot, spot.object, said.text, mark, aside)
    return replace(found, hint=in_keys(said.hint))


def findings_of(network: CheckedNetwork, rules: Sequence[LintRule]) -> Iterator[NetworkFinding]:
    """Apply *rules* to *network*, with places in its file."""
    from dvtcli.domain.network.check.checked_network import mark_of
    from dvtcli.domain.network.check.network_rules import network_findings

    state = network.state
    for rule, spot, text in network_findings(network, {rule.name for rule in rules}):
        aside, mark = _is_aside(state, spot), mark_of(state, spot)
        found = _finding(rule.name, str(rule.severity), spot.node_id, spot, spot.object, text, mark, aside)
        yield replace(found, hint=rule.hint) if state.file and rule.hint else found


def _is_aside(state: NetworkState, spot: NetSpot) -> bool:
    """Tell whether *spot* is a PDO that the file does not name."""
    node = None if spot.node_id is None or spot.pdo is None else state.node(spot.node_id)
    return bool(state.file) and node is not None and spot.pdo not in node.marks


def without_repeats(first: Sequence[NetworkFinding], others: Iterable[NetworkFinding]) -> Iterator[NetworkFinding]:
    """Yield *first*, then *others*, without repetitions, even under another rule name for the same PDO."""
    from dvtcli.domain.network.check.network_rules import SAME_RULES, SUPERSEDED

    said = {(finding.node, finding.pdo, finding.rule) for finding in first}
    texts = {(finding.node, finding.text) for finding in first}
    new: list[NetworkFinding] = []
    for other in dict.fromkeys(others):
        same = SAME_RULES.get(other.rule, ())
        if not any((other.node, other.pdo, name) in said for name in same) and (other.node, other.text) not in texts:
            new.append(other)
    superseded = {(finding.node, finding.pdo, name) for finding in new for name in SUPERSEDED.get(finding.rule, ())}
    yield from (finding for finding in _once(first) if (finding.node, finding.pdo, finding.rule) not in superseded)
    yield from _once(new)


def _once(findings: Iterable[NetworkFinding]) -> Iterator[NetworkFinding]:
    """Yield *findings* that say the same at the same place of the file once, such as of two equal dummies."""
    seen: dict[NetworkFinding, NetworkFinding] = {}
    for finding in findings:
        seen.setdefault(replace(finding, object="") if finding.column else finding, finding)
    yield from seen.values()


def _finding(
    rule: str, severity: str, node: int | None, spot: NetSpot | None, about: str, text: str, mark: Mark | None,
    is_aside: bool = False,
) -> NetworkFinding:  # fmt: skip
    pdo = None if spot is None else spot.pdo
    what = pdo.label if pdo is not None else f"0x{about}" if about else ""
    what = "" if text.startswith(what) else f" {what}"
    who = "" if node is None or (not what and text.startswith(f"node {node} ")) else f"node {node}{what}: "
    line, column, width = (mark.line, mark.column, mark.width) if mark is not None and mark.line else (1, 0, 0)
    end = column + max(width, 1) - 1 if column else 0
    return NetworkFinding(
        line, severity, rule, about, f"{who}{text}", column, end, node=node,
        pdo=None if pdo is None else str(pdo), is_aside=is_aside and severity != "error",
    )  # fmt: skip
