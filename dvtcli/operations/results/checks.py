"""The results of `check` and `eds check`: of files, networks and recordings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Protocol

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.text import join_some, plural
from dvtcli.domain.times import utc
from dvtcli.errors import DvtcliError, UsageError, ended_with
from dvtcli.operations.results.documents import Answer, Document, Short

if TYPE_CHECKING:
    from dvtcli.domain.hint import Hint
    from dvtcli.domain.lint import LintRule
    from dvtcli.domain.rules.finding import FileComplaint


@dataclass(frozen=True, slots=True)
class FileFinding(Short):
    """A finding of *rule*: its line (1 and up), first and last *column*, 0 for none.

    *object* is printed as `6C01:01`, empty for the file as a whole. *hint* is what to do, None if nothing is known.
    """

    line: int
    severity: str
    rule: str
    object: str
    text: str
    column: int = 0
    end_column: int = 0
    hint: Hint | str | None = field(default=None, compare=False)

    def document(self) -> Document:
        """An element of `findings` in `dvtcli.eds/1`."""
        return {
            "line": self.line,
            "column": self.column or None,
            "end_column": self.end_column or None,
            "severity": self.severity,
            "rule": self.rule,
            "object": self.object or None,
            "text": self.text,
        }


@dataclass(frozen=True, slots=True)
class NetworkFinding(FileFinding):
    """A finding in a network, about *node* and *pdo*; of a bus, which has no lines, its line is 0.

    *complaint* is its line of the file, None if it has none. *is_aside*: no error, and about a PDO that the file does
    not name.
    """

    node: int | None = None
    pdo: str | None = None
    complaint: FileComplaint | None = None
    is_aside: bool = False

    def document(self) -> Document:
        """An element of `findings` in `dvtcli.network-check/1`."""
        return {
            "line": self.line or None,
            "column": self.column or None,
            "severity": self.severity,
            "rule": self.rule,
            "node": self.node,
            "pdo": self.pdo,
            "object": self.object or None,
            "text": self.text,
            "hint": self.hint,
        }


class Judged:
    """A report with *findings*; *strict* treats warnings as errors."""

    __slots__ = ()
    findings: Sequence[FileFinding]
    strict: bool

    def is_bad(self, finding: FileFinding) -> bool:
        """Tell whether *finding* makes it invalid."""
        return finding.severity == "error" or (self.strict and finding.severity == "warning")

    def count(self) -> dict[str, int]:
        """Count findings by severity."""
        counted = Counter(finding.severity for finding in self.findings)
        return {severity: counted[severity] for severity in SEVERITIES}


class JudgedReports:
    """The *reports* of several files, of a bus, or of several recordings."""

    __slots__ = ()
    reports: Sequence[NetworkReport] | Sequence[RecordingReport]

    def __bool__(self) -> bool:
        """Tell whether nothing is wrong."""
        return self.exit_code == 0

    @property
    def exit_code(self) -> int:
        """4 for an invalid file or a damaged recording, else 3 for faults on a bus or in one, else 2 for no file."""
        return max((report.exit_code for report in self.reports), default=0)

    @property
    def failure_of_document(self) -> DvtcliError | None:
        """The error for a nonzero exit code: it names the invalid reports, else those that cannot be read."""
        unread = [report.path for report in self.reports if report.unread]
        wrong = wrong_reports(self.reports) or f"{', '.join(unread)} cannot be read"
        return ended_with(self.exit_code, wrong) if self.exit_code else None


@dataclass(frozen=True, slots=True)
class NetworkReport(Short, Judged):
    """The findings of *rules* for a file, or for a bus if *is_live*; *bus* is the bus that a file was compared with.

    *nodes* have name, node-ID and number of PDOs; *notes* are parts of the file without meaning here: line, column,
    count, text. *strict* treats warnings as errors. *unread* is the exit code of an unreadable file, else 0. *heard* is
    the time of recording (s) and the number of others' frames. *said* counts findings of a bus that an earlier file
    has. *folded* counts findings, no errors, about PDOs that the file does not name.
    """

    made_by: ClassVar = "check"

    path: str
    rules: tuple[FileRule, ...]
    findings: tuple[NetworkFinding, ...]
    nodes: tuple[tuple[str, int, int], ...] = ()
    links: int = 0
    notes: tuple[tuple[int, int, int, str], ...] = ()
    is_live: bool = False
    strict: bool = False
    unread: int = 0
    heard: tuple[float, int] | None = None
    bus: str = ""
    said: int = 0
    folded: int = 0

    def is_bad(self, finding: FileFinding) -> bool:
        """Tell whether *finding* makes it invalid; findings about PDOs outside the file never do."""
        aside = isinstance(finding, NetworkFinding) and finding.is_aside
        return finding.severity == "error" or (self.strict and finding.severity == "warning" and not aside)

    @property
    def exit_code(self) -> int:
        """2 for a missing file, 4 for an invalid file, 3 for faulty nodes."""
        return self.unread or ((3 if self.is_live else 4) if any(map(self.is_bad, self.findings)) else 0)

    def fields(self) -> Document:
        """An element of `files` in `dvtcli.network-check/1`."""
        return {
            "file": self.path if self.bus or not self.is_live else None,
            "bus": self.bus or (self.path if self.is_live else None),
            "heard": None if self.heard is None else {"seconds": round(self.heard[0], 3), "frames": self.heard[1]},
            "nodes": [{"name": name or None, "node": node, "pdos": pdos} for name, node, pdos in self.nodes],
            "links": self.links,
            "notes": [dict(zip(("line", "column", "times", "text"), note, strict=True)) for note in self.notes],
            "rules": len(self.rules),
            "count": self.count(),
            "said": self.said,
            "folded": self.folded,
            "findings": [finding.document() for finding in self.findings],
        }


@dataclass(frozen=True, slots=True)
class FileReport(Judged, Answer):
    """The result of `eds check`: sections in the file, sections understood, *rules* applied, findings by line.

    *strict* treats warnings as errors.
    """

    renderer: ClassVar = "check_lines:check_lines"
    formats: ClassVar = {
        "github": "github_lines",
        "junit": "junit_lines",
        "sarif": "sarif_lines",
    }
    use_pager: ClassVar = True
    made_by: ClassVar = "eds check"

    path: str
    sections: int
    understood: int
    objects: int
    rules: tuple[FileRule, ...]
    findings: tuple[FileFinding, ...]
    strict: bool = False

    @property
    def reports(self) -> tuple[FileReport, ...]:
        """Itself."""
        return (self,)

    def __bool__(self) -> bool:
        """Tell whether the file is valid."""
        return not self.exit_code

    @property
    def exit_code(self) -> int:
        """4 for an error among the findings."""
        return 4 if any(self.is_bad(finding) for finding in self.findings) else 0

    @property
    def failure_of_document(self) -> DvtcliError | None:
        """The error for a nonzero exit code, for programs."""
        return ended_with(4, wrong_reports(self.reports)) if self.exit_code else None

    def document(self) -> Document:
        """`dvtcli.eds/1`."""
        return {"schema": "dvtcli.eds/1", **self.fields()}

    def fields(self) -> Document:
        """The document's fields about the file."""
        return {
            "file": self.path,
            "sections": self.sections,
            "understood": self.understood,
            "objects": self.objects,
            "strict": self.strict,
            "rules": len(self.rules),
            "count": self.count(),
            "findings": [finding.document() for finding in self.findings],
        }


@dataclass(frozen=True, slots=True)
class NetworksChecked(JudgedReports, Answer):
    """The result of `check`: a report for each file, and for the bus."""

    renderer: ClassVar = "check_lines:network_check_lines"
    formats: ClassVar = FileReport.formats
    use_pager: ClassVar = True

    reports: tuple[NetworkReport, ...]

    def document(self) -> Document:
        """`dvtcli.network-check/1`."""
        return {"schema": "dvtcli.network-check/1", "files": [report.fields() for report in self.reports]}


@dataclass(frozen=True, slots=True)
class RecordingFinding(FileFinding):
    """A problem in a recording; *line* is the number of its first frame.

    *parties* are concerned, *look* is what to look at first. It happened *times* times, from *first_s* to *last_s* (s
    since 1970, as recorded); *frames* are the numbers of the first ones. *node* is a node-ID, *bus* the channel, empty
    if the recording names none.
    """

    parties: str = ""
    look: str = ""
    first_s: float = 0.0
    last_s: float = 0.0
    times: int = 1
    frames: tuple[int, ...] = ()
    node: int | None = None
    bus: str = ""

    def document(self) -> Document:
        """An element of `findings` in `dvtcli.recording-check/1`."""
        return {
            "severity": self.severity,
            "rule": self.rule,
            "bus": self.bus or None,
            "node": self.node,
            "object": self.object or None,
            "parties": self.parties,
            "text": self.text,
            "look": self.look,
            "first": utc(self.first_s) if self.frames else None,
            "last": utc(self.last_s) if self.frames else None,
            "times": self.times,
            "frames": list(self.frames),
        }


@dataclass(frozen=True, slots=True)
class RecordingReport(Short, Judged):
    """The findings of *rules* in the recording *path*, which has *frames* from *first_s* to *last_s* (s since 1970).

    *unread* is the exit code of a file that cannot be read, else 0. *unseen* are the node-IDs of the network file, of
    which *described* is the number, that sent nothing.
    """

    made_by: ClassVar = "check"

    path: str
    rules: tuple[FileRule, ...]
    findings: tuple[RecordingFinding, ...]
    frames: int = 0
    first_s: float = 0.0
    last_s: float = 0.0
    strict: bool = True
    unread: int = 0
    #: node-IDs of the network file (`-d`) that sent nothing
    unseen: tuple[int, ...] = ()
    described: int = 0

    @property
    def exit_code(self) -> int:
        """2 for a missing file, 4 for a damaged one, 3 for an error or a warning among the findings."""
        return self.unread or (3 if any(map(self.is_bad, self.findings)) else 0)

    def fields(self) -> Document:
        """An element of `files` in `dvtcli.recording-check/1`."""
        return {
            "file": self.path,
            "frames": self.frames,
            "seconds": round(self.last_s - self.first_s, 6),
            "rules": len(self.rules),
            "count": self.count(),
            "unseen": list(self.unseen),
            "findings": [finding.document() for finding in self.findings],
        }


@dataclass(frozen=True, slots=True)
class RecordingsChecked(JudgedReports, Answer):
    """The result of `check` for recordings: a report for each."""

    renderer: ClassVar = "check_lines:recording_lines"
    formats: ClassVar = FileReport.formats
    use_pager: ClassVar = True

    reports: tuple[RecordingReport, ...]

    def document(self) -> Document:
        """`dvtcli.recording-check/1`."""
        return {"schema": "dvtcli.recording-check/1", "files": [report.fields() for report in self.reports]}


#: From bad to harmless.
SEVERITIES = ("error", "warning", "note")


@dataclass(frozen=True, slots=True)
class FileRule(Short):
    """An applied rule: *name*, *severity*, meaning (*sense*), *source*."""

    name: str
    severity: str
    sense: str
    source: str


def rules_among(
    rules: Iterable[LintRule], only: Collection[str], without: Collection[str], about: str, page: str
) -> tuple[LintRule, ...]:
    """Return the *rules* in *only* (empty: all) except *without*; *page* documents all rules *about* this subject.

    Raises UsageError for an unknown name, or if no rule is left: what no rule looks at was not checked.
    """
    known = {rule.name: rule for rule in rules}
    for name in (*only, *without):
        if name not in known:
            from difflib import get_close_matches

            near = get_close_matches(name, known, 1)
            hint = f"did you mean {near[0]}?" if near else f"{page} has them all"
            raise UsageError(f"unknown rule {name!r} about {about}", hint=hint)
    chosen = tuple(rule for name, rule in known.items() if name not in without and (not only or name in only))
    if not chosen:
        hint = "choose at least one rule"
        raise UsageError("no rule is left to check", given={"without": None}, hint=hint)
    return chosen


def asked_rules(rules: Iterable[LintRule]) -> tuple[FileRule, ...]:
    """Return *rules* as a report names them."""
    return tuple(FileRule(rule.name, str(rule.severity), rule.sense, rule.source) for rule in rules)


def judged_rules(
    rules: Sequence[LintRule], only: Collection[str], of_bit_rate: Collection[str], bit_rate: int | None
) -> tuple[LintRule, ...]:
    """Return the *rules* that can be judged: those named in *of_bit_rate* need a known *bit_rate* (bit/s).

    Raises UsageError for another one in *only*, or if none is left: what no rule looks at was not checked.
    """
    judged = tuple(rule for rule in rules if bit_rate is not None or rule.name not in of_bit_rate)
    for rule in rules:
        if rule not in judged and (rule.name in only or not judged):
            raise UsageError(
                f"rule {rule.name} cannot be judged: the bit rate is unknown",
                hint=Hint(
                    Action.GIVE_BIT_RATE, why="give {} (bit/s), or, in a network file, master: {{baudrate: …}} (kbit/s)"
                ),
            )
    return judged


@dataclass(frozen=True, slots=True)
class FileReports(Answer):
    """Reports of several *files*, checked by the same rules."""

    renderer: ClassVar = "check_lines:checks_lines"
    formats: ClassVar = FileReport.formats
    use_pager: ClassVar = True

    files: tuple[FileReport, ...]

    @property
    def reports(self) -> tuple[FileReport, ...]:
        """A report per file."""
        return self.files

    def __bool__(self) -> bool:
        """Tell whether all files are valid."""
        return not self.exit_code

    @property
    def exit_code(self) -> int:
        """4 for an error in any file."""
        return max(file.exit_code for file in self.files)

    def count(self) -> dict[str, int]:
        """Count findings of all files by severity."""
        counted = [file.count() for file in self.files]
        return {severity: sum(file_counts[severity] for file_counts in counted) for severity in SEVERITIES}

    @property
    def failure_of_document(self) -> DvtcliError | None:
        """The error for a nonzero exit code, for programs."""
        return ended_with(4, wrong_reports(self.reports)) if self.exit_code else None

    def document(self) -> Document:
        """`dvtcli.eds-files/1`."""
        bad = sum(1 for file in self.files if file.exit_code)
        return {
            "schema": "dvtcli.eds-files/1",
            "bad": bad,
            "count": self.count(),
            "files": [file.fields() for file in self.files],
        }


def wrong_reports(reports: Sequence[Report]) -> str:
    """Name the invalid *reports* and their number of findings."""
    counted = ((report.path, sum(map(report.is_bad, report.findings))) for report in reports)
    return join_some([f"{path} has {plural(count, 'finding')}" for path, count in counted if count])


class Report(Protocol):
    """The findings of rules for a file or bus, *path*; *made_by* is the command."""

    made_by: ClassVar[str]

    @property
    def path(self) -> str:
        """The file or bus."""
        ...

    @property
    def rules(self) -> tuple[FileRule, ...]:
        """The applied rules."""
        ...

    @property
    def findings(self) -> tuple[FileFinding, ...]:
        """Their findings."""
        ...

    def is_bad(self, finding: FileFinding) -> bool:
        """Tell whether *finding* makes it invalid."""
        ...

    def count(self) -> dict[str, int]:
        """Count findings by severity."""
        ...


class Reported(Protocol):
    """A result with reports."""

    @property
    def reports(self) -> Sequence[Report]:
        """A report per file or bus."""
        ...
