"""Findings of the EDS/DCF reader about a file, by line, and the rules that it checks while reading."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from dvtcli.domain.lint import ERROR, NOTE, WARNING, LintRule
from dvtcli.domain.profile import Severity


class EdsFinding(NamedTuple):
    """An oddity of a file: *line* (from 1), severity, *rule* by its short name, and *text* with the reader's reaction.

    *text* quotes the file unchanged; a view must make control characters harmless. *object* is the object concerned in
    printed form (`6C01:01`), empty if none or not yet looked up. *value_lost*: a ParameterValue (actualValue) could not
    be read, so the wanted value is unknown. *value_unread*: a value belongs to no object, or is repeated, and has no
    effect.
    """

    line: int
    severity: Severity
    rule: str
    text: str
    object: str = ""
    value_lost: bool = False
    value_unread: bool = False


@dataclass(slots=True, eq=False, repr=False)
class Findings:
    """Findings collected while a file, or a single object, is read."""

    found: list[EdsFinding] = field(default_factory=list)

    def add(
        self, rule: LintRule, line: int, text: str, *, value_lost: bool = False, value_unread: bool = False
    ) -> None:
        """Record a finding of *rule* in *line*; *text* has the details and the reader's reaction."""
        self.found.append(EdsFinding(line, rule.severity, rule.name, text, "", value_lost, value_unread))

    def in_order(self) -> tuple[EdsFinding, ...]:
        """Return all findings by line, with one note per key name for empty values."""
        empty = [finding for finding in self.found if finding.rule == EMPTY_VALUE.name]
        rest = [finding for finding in self.found if finding.rule != EMPTY_VALUE.name]
        return tuple(sorted([*rest, *_summarised(empty)], key=lambda finding: finding.line))


def _summarised(empty: list[EdsFinding]) -> list[EdsFinding]:
    """Replace hundreds of notes by one per key: CiA 306 allows an empty value without meaning."""
    lines: dict[str, list[int]] = {}
    for finding in empty:
        lines.setdefault(finding.text, []).append(finding.line)
    return [
        EdsFinding(
            min(at), EMPTY_VALUE.severity, EMPTY_VALUE.name, f"{len(at)} empty {key}, the first here: no value is known"
        )
        for key, at in lines.items()
    ]


_LINES = "CiA 306, 4.2"
_OBJECTS = "CiA 306, 4.6.3"
_COMPACT = "CiA 306, 4.6.3.3"
# Lines and sections.
BAD_HEADER = LintRule("bad-header", WARNING, "a header has no closing bracket, or text after it", _LINES)
BAD_LINE = LintRule("bad-line", WARNING, "a line is neither KEY=VALUE nor a comment, or says nothing there", _LINES)
DUPLICATE_KEY = LintRule("duplicate-key", WARNING, "a key occurs twice in a section: readers differ in which counts",
                         _LINES)  # fmt: skip
DUPLICATE_SECTION = LintRule("duplicate-section", WARNING,
                             "a section occurs twice: many readers refuse the file or drop it", _LINES)  # fmt: skip
NOT_UNDERSTOOD = LintRule("section-not-understood", NOTE, "a section is not the standard's, or its object is not there",
                          "CiA 306")  # fmt: skip
# Values.
BAD_NUMBER = LintRule("bad-number", WARNING, "a key's value is not a number, or outside what the key may have", _LINES)
LEADING_ZERO = LintRule("leading-zero", WARNING, "a leading 0 makes a number octal: readers differ", _LINES)
EMPTY_VALUE = LintRule("empty-value", NOTE, "a key is there without a value", _OBJECTS)
BAD_VALUE = LintRule("bad-value", ERROR, "DefaultValue or ParameterValue does not fit the object's data type", _OBJECTS)
VALUE_TWICE = LintRule("value-twice", ERROR, "two values of one object: the right value is not known", _OBJECTS)
UNTYPED_VALUE = LintRule("untyped-value", WARNING, "a value of an object whose data type is not known", _OBJECTS)
ODD_VALUE = LintRule("odd-value", NOTE, "a value is written in a way that other readers may not take", _LINES)
LIMIT_TYPE = LintRule("limit-type", WARNING, "LowLimit or HighLimit does not fit the object's data type", _OBJECTS)
LIMITS_CROSSED = LintRule("limits-crossed", ERROR, "LowLimit is above HighLimit: no value would be allowed", _OBJECTS)
LIMITS_WRAPPED = LintRule(
    "limits-wrapped",
    WARNING,
    "HighLimit is beyond the object's data type, where it stands for a negative number: below LowLimit",
    _OBJECTS,
)
LIMIT_WITHOUT_SENSE = LintRule("limit-without-sense", NOTE, "a limit of a value that is not a number", _OBJECTS)
# Objects.
NO_NAME = LintRule("no-name", WARNING, "no ParameterName", _OBJECTS)
NO_DATA_TYPE = LintRule("no-data-type", WARNING, "no DataType: the length is not known", _OBJECTS)
IMPLIED_DATA_TYPE = LintRule("implied-data-type", NOTE, "no DataType, but the standard says which", _OBJECTS)
UNKNOWN_DATA_TYPE = LintRule("unknown-data-type", WARNING, "a data type that CiA 301 does not have",
                             "CiA 301, table 44")  # fmt: skip
ACCESS_TYPE = LintRule("access-type", WARNING, "AccessType is missing, or none of ro wo rw rwr rww const", _OBJECTS)
OBJECT_TYPE = LintRule("object-type", WARNING, "an ObjectType that CiA 301 does not have", "CiA 301, table 42")
NO_OBJECT_TYPE = LintRule("no-object-type", NOTE, "no ObjectType, yet sub-indices", _OBJECTS)
SUB_INDICES_OF_VAR = LintRule("sub-indices-of-var", WARNING, "an object of one entry (VAR, DOMAIN) has sub-indices",
                              "CiA 301, table 42")  # fmt: skip
NO_PARENT = LintRule("no-parent", WARNING, "sub-indices without the object's own section", _OBJECTS)
SUB_BEFORE_PARENT = LintRule("sub-before-parent", NOTE, "a sub-index is listed before its object", _OBJECTS)
NO_SUB_INDICES = LintRule("no-sub-indices", WARNING, "an ARRAY or RECORD without any sub-index", _OBJECTS)
SUB_NUMBER = LintRule("sub-number", NOTE, "SubNumber is not the number of sub-indices in the file", _OBJECTS)
# Objects in short form.
COMPACT_PDO = LintRule("compact-pdo", NOTE, "PDO parameters that only CompactPDO describes", "CiA 306, CompactPDO")
COMPACT_PDO_BITS = LintRule("compact-pdo-bits", WARNING, "CompactPDO has bits without a meaning", "CiA 306, CompactPDO")
COMPACT_COUNT = LintRule("compact-count", NOTE, "CompactSubObj makes a sub-index 0 read-only that must be written",
                         f"{_COMPACT}; CiA 301, 7.5.2.36")  # fmt: skip
TABLE_COUNT = LintRule("table-count", NOTE, "NrOfEntries is not the number of rows", _COMPACT)
NO_SUB_INDEX = LintRule(
    "no-sub-index", WARNING, "a row of a table names a sub-index that the object does not have", _COMPACT
)
# The device and the lists of objects.
DEVICE_IDENTITY = LintRule("device-identity", WARNING, "VendorNumber, ProductNumber or RevisionNumber is not the "
                           "value of 0x1018: the file does not identify the device", "CiA 306, DeviceInfo")  # fmt: skip
NODE_ID = LintRule(
    "node-id", WARNING, "NodeID is not within 1..127, or occurs twice and differs", "CiA 306, DeviceComissioning"
)
NO_NODE_ID = LintRule("no-node-id", NOTE, "NodeID=255: the node is not configured", "CiA 305")
LIST_COUNT = LintRule("list-count", WARNING, "SupportedObjects is not the number of objects in the list",
                      "CiA 306, 4.6.2")  # fmt: skip
NOT_LISTED = LintRule("not-listed", WARNING, "an object is in no list: tools that follow the lists drop it",
                      "CiA 306, 4.6.2")  # fmt: skip
LISTED_TWICE = LintRule("listed-twice", NOTE, "an object is listed twice", "CiA 306, 4.6.2")
NO_SECTION = LintRule("no-section", ERROR, "an object is listed and not described", "CiA 306, 4.6.2")
#: All rules of this file.
READ_RULES = tuple(value for value in tuple(globals().values()) if isinstance(value, LintRule))
