"""Network files, checked without any node. Writes nothing.

Judges nothing itself: the rules are in `domain/network/check`, and those of `map` and `link`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import TYPE_CHECKING

from dvtcli.domain.lint.lint_rule import ERROR, LintRule
from dvtcli.errors import DvtcliError, InputFileError, RuleError, UsageError
from dvtcli.operations.network.unknown_names import unknown_names
from dvtcli.operations.results.checked_files import FileRule
from dvtcli.operations.results.checked_networks import NetworkFinding, NetworkReport, NetworksChecked
from dvtcli.operations.wanted.network_wish import read_wish

if TYPE_CHECKING:
    from dvtcli.domain.file_complaint import FileComplaint
    from dvtcli.domain.network.check.checked_network import CheckedNetwork, NetSpot
    from dvtcli.domain.network.network_state import NetworkState
    from dvtcli.domain.network.wanted_state import FileNote, Mark, NetworkWish
    from dvtcli.operations.user.telling import Teller

#: Rules that no state is asked for.
FILE_RULES = (
    LintRule("network-file", ERROR, "the file cannot be read, or says what its nodes cannot mean",
             "the network file's keys; the nodes' dictionaries"),
    LintRule("cannot-be-made", ERROR, "what the file wants cannot be made on its nodes",
             "the rules of `map` and `link`"),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class CheckWishes:
    """How `check` looks: which rules by name (*only*, none: all; not those in *without*).

    With *strict* a warning is as bad as an error; *bit_rate* (bit/s) is the bus's, None for what a file says. With
    *as_findings* what cannot be read of a file is a finding, and no error. A bus is listened to for *for_s* seconds
    (None: `LISTEN_S`, and not at all where nobody else can be on it).
    """

    only: Collection[str] = ()
    without: Collection[str] = ()
    strict: bool = False
    bit_rate: int | None = None
    as_findings: bool = False
    for_s: float | None = None


def check_networks(
    files: Sequence[str], wishes: CheckWishes | None = None, on_bus: Mapping[str, Mapping[int, str]] | None = None
) -> NetworksChecked:
    """Look at each of *files*: what the rules found; *on_bus* has for each what describes nodes besides, by node-ID.

    What cannot be read is a finding where several files are looked at, so that the others are, too; of one file it is
    InputFileError with all that is wrong in it, or UsageError where it is not there. UsageError for a rule that there
    is not.
    """
    wishes = wishes or CheckWishes()
    rules, names = chosen_rules(wishes), tuple(dict.fromkeys(files))
    report = _report if len(names) == 1 and not wishes.as_findings else _report_anyway
    told = on_bus or {}
    return NetworksChecked(tuple(report(file, wishes, rules, told.get(file, {})) for file in names))


def chosen_rules(wishes: CheckWishes) -> tuple[LintRule, ...]:
    """The rules that *wishes* name; UsageError for one that there is not."""
    from dvtcli.domain.network.check.network_rules import NETWORK_RULES

    known = {rule.name: rule for rule in (*FILE_RULES, *NETWORK_RULES)}
    for name in (*wishes.only, *wishes.without):
        if name not in known:
            near = get_close_matches(name, known, n=1)
            raise UsageError(f"there is no rule {name!r}", hint=f"did you mean {near[0]}?" if near else None)
    return tuple(
        rule for name, rule in known.items() if name not in wishes.without and (not wishes.only or name in wishes.only)
    )


def asked_rules(rules: Sequence[LintRule]) -> tuple[FileRule, ...]:
    """*rules* as an answer names them."""
    return tuple(FileRule(rule.name, str(rule.severity), rule.sense, rule.source) for rule in rules)


def _report(file: str, wishes: CheckWishes, rules: tuple[LintRule, ...], on_bus: Mapping[int, str]) -> NetworkReport:
    """What there is to say of *file*; InputFileError or UsageError where it cannot be read."""
    wish = read_wish(file)
    _, findings = judged_file(file, wish, wishes, on_bus)
    nodes = tuple((node.name, node.node_id, len(node.pdos)) for node in wish.nodes)
    notes = tuple(
        (one.mark.line, one.mark.column, one.times, one.text)
        for one in (*wish.notes, *unknown_names(file, wish, on_bus), *_described(file, wish))
    )
    return NetworkReport(file, asked_rules(rules), findings, nodes, len(wish.links), notes, strict=wishes.strict)


def _described(file: str, wish: NetworkWish) -> Iterator[FileNote]:
    """A note for each node that a file of the library describes which may not be quite its own."""
    from dvtcli.domain.network.wanted_state import FileNote
    from dvtcli.operations.network.described_network import library_match

    for node in wish.nodes:
        found = library_match(file, node)
        if found is not None and (remark := found.remark("in `identity:`")):
            yield FileNote(f"node {node.node_id}: {remark}", node.mark)


def _report_anyway(
    file: str, wishes: CheckWishes, rules: tuple[LintRule, ...], on_bus: Mapping[int, str]
) -> NetworkReport:
    """The same, with findings of what cannot be read."""
    try:
        return _report(file, wishes, rules, on_bus)
    except (InputFileError, UsageError) as failed:
        found = tuple(_unreadable(failed, file))
        asked = tuple(dict.fromkeys((FILE_RULES[0], *rules)))
        return NetworkReport(file, asked_rules(asked), found, strict=wishes.strict, unread=failed.exit_code)


def _unreadable(failed: DvtcliError, file: str) -> Iterator[NetworkFinding]:
    name, complaints = FILE_RULES[0].name, getattr(failed, "complaints", ())
    if not complaints:
        text = failed.text.removeprefix(f"{file}: ")
        yield NetworkFinding(1, "error", name, "", f"{text}: {failed.why}" if failed.why else text)
    yield from (replace(_at(one, name), complaint=one) for one in complaints)


def _at(one: FileComplaint, rule: str) -> NetworkFinding:
    """What *rule* finds where *one* is."""
    return NetworkFinding(one.line, "error", rule, "", one.text, one.column, one.column + max(one.width, 1) - 1)


def judged_file(
    file: str,
    wish: NetworkWish,
    wishes: CheckWishes,
    on_bus: Mapping[int, str] | None = None,
    tell: Teller | None = None,
) -> tuple[NetworkState | None, tuple[NetworkFinding, ...]]:
    """The network that *wish*, from *file*, makes, and what the rules say of it.

    Where it cannot be made a finding says why, and it is that without its links; None where that cannot be made, too.
    """
    from dvtcli.domain.network.check.checked_network import CheckedNetwork
    from dvtcli.operations.network.described_network import described_network

    rules, refused = chosen_rules(wishes), list[NetworkFinding]()
    try:
        state = described_network(file, tell, for_rules=True, on_bus=on_bus, wish=wish)
    except (RuleError, UsageError) as failed:
        if FILE_RULES[1] in rules:
            refused += _refused(wish, failed)
        try:
            state = described_network(file, tell, for_rules=True, with_links=False, on_bus=on_bus, wish=wish)
        except (RuleError, UsageError):
            return None, tuple(refused)
    return state, (*refused, *findings_of(CheckedNetwork(state, wishes.bit_rate or state.bit_rate), rules))


def _refused(wish: NetworkWish, refused: DvtcliError) -> Iterator[NetworkFinding]:
    """Each reason, where the file asks for it; where that is not known, at the node that it is about."""
    if complaints := getattr(refused, "complaints", ()):
        yield from (_at(one, FILE_RULES[1].name) for one in complaints)
        return
    marks = {node.node_id: node.mark for node in wish.nodes}
    mark = marks.get(refused.node or 0) or (wish.links[0].mark if wish.links else None)
    findings = getattr(refused, "findings", ()) or ()
    for text in [one.text for one in findings if one.severity is ERROR] or [refused.text]:
        yield _finding(FILE_RULES[1], refused.node, None, "", text, mark)


def findings_of(network: CheckedNetwork, rules: Sequence[LintRule]) -> Iterator[NetworkFinding]:
    """What *rules* say of *network*, at the places of its file."""
    from dvtcli.domain.network.check.network_rules import network_findings

    for rule, spot, text in network_findings(network, {rule.name for rule in rules}):
        yield _finding(rule, spot.node_id, spot, spot.object, text, _mark(network.state, spot))


def _mark(state: NetworkState, spot: NetSpot) -> Mark | None:
    """Where the file speaks of it: of the PDO, else of the node."""
    node = None if spot.node_id is None else state.node(spot.node_id)
    if node is None:
        return None
    return node.mark if spot.pdo is None else node.marks.get(spot.pdo, node.mark)


def _finding(
    rule: LintRule, node: int | None, spot: NetSpot | None, about: str, text: str, mark: Mark | None
) -> NetworkFinding:
    pdo = None if spot is None else spot.pdo
    who = "" if node is None else f"node {node}" + (f" {pdo.label}" if pdo else f" 0x{about}" if about else "") + ": "
    line, column, width = (mark.line, mark.column, mark.width) if mark is not None and mark.line else (1, 0, 0)
    end = column + max(width, 1) - 1 if column else 0
    return NetworkFinding(
        line, str(rule.severity), rule.name, about, f"{who}{text}", column, end, node, None if pdo is None else str(pdo)
    )
