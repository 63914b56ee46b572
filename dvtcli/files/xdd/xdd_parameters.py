"""The parameters of an XDD or XDC file, and the rules that are checked while it is read, beside those of an EDS."""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

from dvtcli.domain.lint import ERROR, NOTE, WARNING, LintRule
from dvtcli.domain.scaling import parse_offset, parse_scale
from dvtcli.files.eds.findings import Findings
from dvtcli.files.xdd.xml_tree import XmlElement

#: IEC 61131-3 types, as an ApplicationProcess names them -> codes of CiA 301, table 44.
TYPES = {
    "BOOL": 0x01, "SINT": 0x02, "INT": 0x03, "DINT": 0x04, "LINT": 0x15, "USINT": 0x05, "UINT": 0x06, "UDINT": 0x07,
    "ULINT": 0x1B, "REAL": 0x08, "LREAL": 0x11, "STRING": 0x09, "WSTRING": 0x0B, "BYTE": 0x05, "WORD": 0x06,
    "DWORD": 0x07, "LWORD": 0x1B, "CHAR": 0x02, "BITSTRING": 0x0A,
}  # fmt: skip
_ACCESS = {
    "const": "const", "read": "ro", "write": "wo", "readWrite": "rw", "readWriteInput": "rwr",
    "readWriteOutput": "rww",
}  # fmt: skip
#: Maximum length of a number.
_LONGEST = 40
#: The default access of a parameter in CiA 311.
_DEFAULT_ACCESS = "ro"


class Parameter(NamedTuple):
    """A *parameter* of the file: its *element*, and the *template* for missing parts."""

    element: XmlElement
    template: XmlElement | None = None

    @property
    def access(self) -> str:
        """The access type in an EDS's words; empty if unknown to CANopen."""
        given = self._attribute("access")
        return _DEFAULT_ACCESS if given is None else _ACCESS.get(given, "")

    @property
    def type_code(self) -> int | None:
        """The code of the data type, None for the file's own types or none."""
        return next(
            (TYPES[element.name] for part in self._parts() for element in part.children if element.name in TYPES), None
        )

    @property
    def label(self) -> str:
        """The name, in English if the file has several languages."""
        return _label(self.element)

    @property
    def denotation(self) -> str:
        """The user's name for the parameter in this device."""
        found = self._child("denotation")
        return "" if found is None else found.attributes.get("value") or _label(found) or found.text.strip()

    @property
    def unit(self) -> str:
        """The label of the unit, followed by the file's scales if ambiguous."""
        label = self._unit_label
        return label if self._is_clear else f"{label} ({', '.join(self._scale_words)})".strip()

    @property
    def factor(self) -> str:
        """The multiplier for value plus offset; empty for 1 or an ambiguous scale."""
        return next(iter(self._multipliers), "") if self._is_clear else ""

    @property
    def offset(self) -> str:
        """The number added to the value before multiplication; empty for 0 or an ambiguous scale."""
        return self._given_offset if self._is_clear else ""

    @property
    def _unit_label(self) -> str:
        found = self._child("unit")
        return "" if found is None else _label(found)

    @property
    def _multipliers(self) -> list[str]:
        """The multipliers of parameter and unit other than 1."""
        unit = self._child("unit")
        given = (self._attribute("multiplier"), None if unit is None else unit.attributes.get("multiplier"))
        return [
            text
            for multiplier in given
            if multiplier is not None and _number(text := multiplier.strip()[:_LONGEST]) != 1
        ]

    @property
    def _given_offset(self) -> str:
        text = (self._attribute("offset") or "").strip()[:_LONGEST]
        return "" if not text or _number(text) == 0 else text

    @property
    def _scale_words(self) -> list[str]:
        offset = [f"offset {self._given_offset}"] if self._given_offset else []
        return [*(f"multiplier {multiplier}" for multiplier in self._multipliers), *offset]

    @property
    def _is_clear(self) -> bool:
        """Whether the file has at most one scale, in numbers; a label like `1/256 V` counts as a scale."""
        numbers = [*map(_number, self._multipliers), *([_number(self._given_offset)] if self._given_offset else [])]
        if None in numbers or 0 in numbers or len(self._multipliers) > 1:
            return False
        return not numbers or parse_scale(self._unit_label)[0] == 1

    def value(self, name: str) -> str | None:
        """Return the value of *name* (`defaultValue`, `actualValue`), None if absent."""
        found = self._child(name)
        return None if found is None else found.attributes.get("value")

    def limit(self, name: str) -> str | None:
        """Return `minValue` or `maxValue` of the range; None if the parameter has several ranges."""
        allowed = self._child("allowedValues")
        ranges = [] if allowed is None or allowed.all("value") else allowed.all("range")
        found = ranges[0].first(name) if len(ranges) == 1 else None
        return None if found is None else found.attributes.get("value")

    def _parts(self) -> list[XmlElement]:
        return [self.element] if self.template is None else [self.element, self.template]

    def _child(self, name: str) -> XmlElement | None:
        return next((found for part in self._parts() if (found := part.first(name)) is not None), None)

    def _attribute(self, name: str) -> str | None:
        return next((part.attributes[name] for part in self._parts() if name in part.attributes), None)


def read_parameters(root: XmlElement, findings: Findings) -> dict[str, Parameter]:
    """The parameters below *root* by their uniqueID."""
    templates = {template.attributes.get("uniqueID", ""): template for template in root.anywhere("parameterTemplate")}
    found: dict[str, Parameter] = {}
    for element in root.anywhere("parameter"):
        name = element.attributes.get("uniqueID", "")
        if name in found:
            findings.add(PARAMETER_TWICE, element.line, f"parameter {name[:60]} occurs twice; the first is used")
            continue
        found[name] = Parameter(element, templates.get(element.attributes.get("templateIDRef", "")))
    return found


def _number(text: str) -> Fraction | None:
    """Return the number in *text*, None if malformed."""
    try:
        return parse_offset(text)
    except ValueError:
        return None


def _label(element: XmlElement) -> str:
    """Return the English label, else the first label."""
    labels = element.all("label")
    best = next((label for label in labels if label.attributes.get("lang", "").lower().startswith("en")), None)
    chosen = best or (labels[0] if labels else None)
    text = "" if chosen is None else chosen.text.strip()
    return " ".join(text.split()) if "\n" in text else text


_OBJECTS = "CiA 311, CANopenObject"
NO_PARAMETER = LintRule("no-parameter", WARNING, "uniqueIDRef names no parameter of the file", "CiA 311, uniqueIDRef")
PARAMETER_TWICE = LintRule("parameter-twice", WARNING, "two parameters have one uniqueID", "CiA 311, uniqueIDRef")
MAPPING_WORD = LintRule("mapping-word", WARNING, "PDOmapping is not one of no, default, optional, TPDO, RPDO", _OBJECTS)
MAPPING_DIRECTION = LintRule("mapping-direction", WARNING, "PDOmapping is a direction that the access type forbids",
                             f"{_OBJECTS}; CiA 301, 7.4.6")  # fmt: skip
OBJECT_TWICE = LintRule("object-twice", WARNING, "an object, or a sub-index of it, is described twice", _OBJECTS)
NO_INDEX = LintRule("no-index", ERROR, "an object, or a sub-index of it, has no number: it is left out", _OBJECTS)
OBJECT_LISTS = LintRule("object-lists", WARNING, "there are several lists of objects: the first is used",
                        "CiA 311, CANopenObjectList")  # fmt: skip
OTHER_NAMESPACE = LintRule("other-namespace", NOTE, "the file is in none of the published namespaces of CiA 311",
                           "CiA 311, 1.0 and 1.1")  # fmt: skip
COMMISSIONING = LintRule("commissioned", NOTE, "a value of deviceCommissioning is none; it is left out",
                         "CiA 311, deviceCommissioning")  # fmt: skip
#: All rules of this file.
XDD_RULES = tuple(value for value in tuple(globals().values()) if isinstance(value, LintRule))
