"""Check recordings: what went wrong on the bus, when, and between whom."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import UsageError
from dvtcli.files.recognised import is_recording
from dvtcli.files.recording import check_readable, read_recorded
from dvtcli.operations.frames.explain_frame import described_nodes
from dvtcli.operations.frames.recorded import decoder_for
from dvtcli.operations.results.checked_files import FileRule, rules_among
from dvtcli.operations.results.checked_recordings import RecordingFinding, RecordingReport, RecordingsChecked
from dvtcli.watch.recording.problems import Problem
from dvtcli.watch.recording.recording_rules import RECORDING_RULES, RecordingCheck

if TYPE_CHECKING:
    from dvtcli.domain.lint.lint_rule import LintRule
    from dvtcli.operations.session.session_nodes import SessionNodes


def are_recordings(files: Sequence[str]) -> bool:
    """Tell by suffixes and content whether *files* are recordings. Raises UsageError if only some are."""
    recordings = [file for file in files if is_recording(Path(file))]
    if recordings and len(recordings) < len(files):
        raise UsageError(
            f"{recordings[0]} is a recording, and others are not",
            hint=Hint(Action.CHECK, {"file": recordings[0]}, "{} checks it; the others by a check of their own"),
        )
    return bool(recordings)


def check_recordings(
    session: SessionNodes,
    files: Sequence[str],
    dbc: str | None = None,
    *,
    only: Collection[str] = (),
    without: Collection[str] = (),
) -> RecordingsChecked:
    """Check each recording in *files* by the rules *only* (empty: all) except *without*.

    PDOs are read by *dbc*, a DBC or network file, else as `decoder_for` does. Raises UsageError for a missing file or
    an unknown rule, InputFileError for a damaged file.
    """
    rules = rules_among(RECORDING_RULES, only, without, "recordings", "docs/reference/recording-rules.md")
    return RecordingsChecked(tuple(_report(session, file, dbc, rules) for file in dict.fromkeys(files)))


def _report(session: SessionNodes, file: str, dbc: str | None, rules: tuple[LintRule, ...]) -> RecordingReport:
    path = Path(file)
    check_readable(path)
    decoder, described = decoder_for(session, None, dbc, path), described_nodes(session, dbc)

    def name_of(node_id: int, index: int, sub_index: int) -> str:
        return described(node_id).value(index, sub_index, None)[0]

    checks: dict[str, RecordingCheck] = {}
    number, first_s, last_s = 0, 0.0, 0.0
    for number, recorded in enumerate(read_recorded(path), 1):
        if number == 1:
            first_s = recorded.frame.timestamp_s
        last_s = recorded.frame.timestamp_s
        if (check := checks.get(recorded.channel)) is None:
            check = checks[recorded.channel] = RecordingCheck(decoder.layout, name_of)
        if recorded.error:
            check.take_error(number, last_s)
        else:
            check.take(number, recorded.frame)
    names = {rule.name for rule in rules}
    found = [
        (problem, bus if len(checks) > 1 else "")
        for bus, check in checks.items()
        for problem in check.problems()
        if problem.rule.name in names
    ]
    found.sort(key=lambda each: each[0].order)
    findings = tuple(_finding(problem, bus) for problem, bus in found)
    asked = tuple(FileRule(rule.name, str(rule.severity), rule.sense, rule.source) for rule in rules)
    return RecordingReport(file, asked, findings, number, first_s, last_s)


def _finding(problem: Problem, bus: str) -> RecordingFinding:
    moments = problem.moments
    return RecordingFinding(
        moments.first.number, str(problem.rule.severity), problem.rule.name, problem.object, problem.text,
        parties=problem.parties, look=problem.look, first_s=moments.first.time_s, last_s=moments.last.time_s,
        times=moments.times, frames=tuple(moments.numbers), node=problem.node, bus=bus,
    )  # fmt: skip
