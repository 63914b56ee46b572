"""The comparison of a whole device with a file, as a result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from dvtcli.domain.datatypes import DataType
from dvtcli.domain.meanings import NOTHING
from dvtcli.domain.scaling import Scaling
from dvtcli.operations.results.documents import CASES, Answer, Document, Short, hex_bytes, json_value, physical_document

if TYPE_CHECKING:
    from dvtcli.errors import DvtcliError


@dataclass(frozen=True, slots=True)
class ObjectDifference(Short):
    """An *object* with *name*: its value *before* on the first side, and *after* on the second.

    None if unknown or unmapped: *unread* has the side's reason. *apart* says why it is no setting, if known.
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

    renderer: ClassVar = "whole_device_lines:whole_compared_lines"
    formats: ClassVar = CASES
    at_leisure: ClassVar = True

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
        failed.state_text = failed.state_text if self.node is not None else "both files are as they were"
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
