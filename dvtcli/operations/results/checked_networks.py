"""The results of `check`: networks and recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from dvtcli.domain.times import utc
from dvtcli.errors import DvtcliError, ended_with
from dvtcli.operations.results.checked_files import FileFinding, FileReport, FileRule, Judged, wrong_reports
from dvtcli.operations.results.documents import Answer, Document, Short

if TYPE_CHECKING:
    from dvtcli.domain.rules.finding import FileComplaint


@dataclass(frozen=True, slots=True)
class NetworkFinding(FileFinding):
    """A finding in a network, about *node* and *pdo*.

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
class NetworksChecked(Answer):
    """The result of `check`: a report for each file, and for the bus."""

    renderer: ClassVar = "check_lines:network_check_lines"
    formats: ClassVar = FileReport.formats
    use_pager: ClassVar = True

    reports: tuple[NetworkReport, ...]

    def __bool__(self) -> bool:
        """Tell whether nothing is wrong."""
        return self.exit_code == 0

    @property
    def exit_code(self) -> int:
        """4 for an invalid file, else 3 for faulty nodes on a bus, else 2 for a missing file."""
        return max((report.exit_code for report in self.reports), default=0)

    @property
    def failure_of_document(self) -> DvtcliError | None:
        """The error for a nonzero exit code, for programs."""
        return _failure_of(self.reports, self.exit_code)

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
class RecordingsChecked(Answer):
    """The result of `check` for recordings: a report for each."""

    renderer: ClassVar = "check_lines:recording_lines"
    formats: ClassVar = FileReport.formats
    use_pager: ClassVar = True

    reports: tuple[RecordingReport, ...]

    def __bool__(self) -> bool:
        """Tell whether nothing is wrong."""
        return self.exit_code == 0

    @property
    def exit_code(self) -> int:
        """4 for a damaged recording, else 3 for an error or a warning in one, else 2 for a missing file."""
        return max((report.exit_code for report in self.reports), default=0)

    @property
    def failure_of_document(self) -> DvtcliError | None:
        """The error for a nonzero exit code, for programs."""
        return _failure_of(self.reports, self.exit_code)

    def document(self) -> Document:
        """`dvtcli.recording-check/1`."""
        return {"schema": "dvtcli.recording-check/1", "files": [report.fields() for report in self.reports]}


def _failure_of(reports: Sequence[NetworkReport] | Sequence[RecordingReport], exit_code: int) -> DvtcliError | None:
    """Make the error for a nonzero *exit_code*: it names the invalid *reports*, else those that cannot be read."""
    unread = [report.path for report in reports if report.unread]
    wrong = wrong_reports(reports) or f"{', '.join(unread)} cannot be read"
    return ended_with(exit_code, wrong) if exit_code else None
