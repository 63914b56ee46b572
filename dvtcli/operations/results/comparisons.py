"""The comparison of a read-back with wanted values, as a result."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from dvtcli.domain.datatypes import DataType
from dvtcli.domain.object_scalings import NOTHING
from dvtcli.domain.ports import Frame
from dvtcli.domain.scaling import Scaling
from dvtcli.operations.results.documents import (
    CASES,
    Answer,
    Document,
    Short,
    hex_bytes,
    json_value,
    lacking_documents,
    physical_document,
)

if TYPE_CHECKING:
    from dvtcli.domain.network.network_plan import MissingObject
    from dvtcli.errors import DvtcliError, RuleError


@dataclass(frozen=True, slots=True)
class Compared(Answer):
    """A read-back compared with wanted values: a row per PDO that differs."""

    renderer: ClassVar = "compare_lines:compared_lines"
    formats: ClassVar = CASES

    node: int
    pdos: int
    parameters: int
    differences: tuple[tuple[str, str], ...] = ()
    against: str = "this session's changes"
    frames: tuple[tuple[str, Frame | None, float], ...] = ()
    state_note: str = ""
    #: number of single objects compared
    objects: int = 0
    #: whether a frame of every enabled TPDO was expected
    frame_asked: bool = False
    #: whether more nodes are known
    named: bool = False
    #: number of further parameters of these PDOs, not in the file
    unsaid: int = 0
    #: objects that cannot be read back, not compared, as `2050:00`
    not_comparable: tuple[str, ...] = ()
    #: every PDO and object compared
    labels: tuple[str, ...] = ()
    #: lines of a network file by label; the node's line for an empty label (0: none)
    lines: Mapping[str, int] = field(default_factory=dict)

    def line_of(self, label: str) -> int:
        """Return the file's line for *label*, a PDO or an object; else for the node."""
        return self.lines.get(label, 0) or self.lines.get("", 0)

    @property
    def frame_missing(self) -> bool:
        """Tell whether a requested frame was not received."""
        return self.frame_asked and (not self.frames or any(frame is None for _, frame, _ in self.frames))

    def __bool__(self) -> bool:
        """Tell whether all is as wanted; `assert` in a test shows the differences."""
        return self.exit_code == 0

    @property
    def exit_code(self) -> int:
        """3 for a difference, 1 for a missing frame."""
        return 3 if self.differences else 1 if self.frame_missing else 0

    @property
    def failure_of_line(self) -> DvtcliError | None:
        """The error of a script line: the screen has the differences, but not the line."""
        from dvtcli.operations.results.failures import not_as_wanted

        differing = list(dict.fromkeys(label for label, _ in self.differences))
        return not_as_wanted(self.node, self.exit_code, differing, self.against) if self.exit_code else None

    def document(self) -> Document:
        """`dvtcli.verify/1`."""
        return {
            "schema": "dvtcli.verify/1",
            "node": self.node,
            "pdos": self.pdos,
            "objects": self.objects,
            "parameters": self.parameters,
            "unsaid": self.unsaid,
            "not_comparable": [{"node": self.node, "object": label} for label in self.not_comparable],
            "equal": not self.differences,
            "lacking": [],
            "differences": [{"node": self.node, **_what(label), "text": text} for label, text in self.differences],
            "frames": [
                {
                    "node": self.node,
                    "pdo": pdo.lower(),
                    "data": None if frame is None else hex_bytes(frame.data),
                    "ms": round(ms, 1),
                }
                for pdo, frame, ms in self.frames
            ],
        }


def _what(label: str) -> Document:
    """Describe a difference: a PDO by its label, or an object."""
    return {"pdo": None, "object": label} if ":" in label else {"pdo": label.lower(), "object": None}


@dataclass(frozen=True, slots=True)
class ComparedNodes(Answer):
    """Comparisons of several nodes; its document has common fields, and each node's."""

    renderer: ClassVar = "compare_lines:compared_nodes_lines"
    formats: ClassVar = CASES

    nodes: tuple[Compared, ...]
    #: objects of a network file that devices lack
    lacking: tuple[MissingObject, ...] = ()

    @property
    def exit_code(self) -> int:
        """1 if devices lack objects of the file, 3 if a node differs, else 1 for a missing frame."""
        return 1 if self.lacking else max(node.exit_code for node in self.nodes)

    @property
    def failure(self) -> RuleError | None:
        """The error for what devices lack."""
        from dvtcli.operations.results.failures import missing_error

        return missing_error(self.lacking) if self.lacking else None

    @property
    def failure_of_line(self) -> DvtcliError | None:
        """The error of a script line, with the node-ID before each PDO."""
        from dvtcli.operations.results.failures import not_as_wanted

        differing = list(
            dict.fromkeys(f"{label} of node {node.node}" for node in self.nodes for label, _ in node.differences)
        )
        return not_as_wanted(None, self.exit_code, differing, self.nodes[0].against) if self.exit_code else None

    def document(self) -> Document:
        """`dvtcli.verify/1` without a node, and with each node's document in `nodes`."""
        documents = [node.document() for node in self.nodes]
        return {
            "schema": "dvtcli.verify/1",
            "node": None,
            **{
                key: sum(document[key] for document in documents) for key in ("pdos", "objects", "parameters", "unsaid")
            },
            "equal": not self.lacking and all(document["equal"] for document in documents),
            "lacking": lacking_documents(self.lacking),
            **{
                key: [row for document in documents for row in document[key]]
                for key in ("not_comparable", "differences", "frames")
            },
            "nodes": documents,
        }


@dataclass(frozen=True, slots=True)
class ObjectDifference(Short):
    """An *object* with *name*: its value *before* on the first side, and *after* on the second.

    None if unknown or unmapped: *unread* has the side's reason. *apart* says why it is not a setting, if known.
    """

    object: str
    name: str
    data_type: DataType | None
    before: bytes | None
    after: bytes | None
    unread: str = ""
    apart: str = ""
    #: its scaling
    meaning: Scaling = NOTHING

    def value(self, data: bytes | None) -> Any:
        """Decode *data*; None if unknown, or invalid for its type."""
        if data is None or self.data_type is None:
            return None
        try:
            return self.data_type.decode(data)
        except ValueError:
            return None

    def _physical(self, data: bytes | None) -> Document | None:
        """Scale *data*, if a scaling is known."""
        value = self.value(data)
        return physical_document(value, self.meaning) if self.meaning.says and value is not None else None

    def document(self) -> Document:
        """Its part of `dvtcli.compare/1`."""
        return {
            "object": self.object,
            "name": self.name,
            "before": hex_bytes(self.before),
            "after": hex_bytes(self.after),
            "value_before": json_value(self.value(self.before)),
            "value_after": json_value(self.value(self.after)),
            "physical_before": self._physical(self.before),
            "physical_after": self._physical(self.after),
            "why": self.unread or self.apart,
        }


@dataclass(frozen=True, slots=True)
class WholeCompared(Answer):
    """The differences between *first*, a file, and *second*, a node or another file: exit code 3 if any.

    *differences* are settings; *about* is the identity; *apart* are commands, measurements and values that change by
    themselves. The latter two are shown but do not count. *objects* is the number of settings compared; *unsaid* of
    settings on a single side.
    """

    renderer: ClassVar = "compare_lines:whole_compared_lines"
    formats: ClassVar = CASES
    use_pager: ClassVar = True

    node: int | None
    first: str
    second: str
    objects: int
    differences: tuple[ObjectDifference, ...] = ()
    about: tuple[ObjectDifference, ...] = ()
    apart: tuple[ObjectDifference, ...] = ()
    unsaid: int = 0
    #: differing numbers of the identity (0x1018); empty if none, or unknown
    unlike: str = ""
    #: settings with a default only, which the other side could not be asked for
    unread: tuple[str, ...] = ()
    #: whether objects that are no settings are shown, too
    shows_all: bool = False

    def __bool__(self) -> bool:
        """Tell whether the settings are equal; `assert` in a test shows the differences."""
        return not self.differences

    @property
    def exit_code(self) -> int:
        """3 for a differing setting."""
        return 3 if self.differences else 0

    @property
    def failure_of_line(self) -> DvtcliError | None:
        """The error of a script line: the differing settings."""
        from dvtcli.operations.results.failures import not_as_wanted

        differing = [difference.object for difference in self.differences]
        if not differing:
            return None
        failed = not_as_wanted(self.node, self.exit_code, differing, self.first)
        failed.state_text = failed.state_text if self.node is not None else "both files are unchanged"
        return failed

    def document(self) -> Document:
        """`dvtcli.compare/1`."""
        return {
            "schema": "dvtcli.compare/1",
            "node": self.node,
            "first": self.first,
            "second": self.second,
            "objects": self.objects,
            "equal": not self.differences,
            "differences": [difference.document() for difference in self.differences],
            "about": [difference.document() for difference in self.about],
            "apart": [difference.document() for difference in self.apart],
            "unsaid": self.unsaid,
            "unread": list(self.unread),
            "unlike": self.unlike,
        }
