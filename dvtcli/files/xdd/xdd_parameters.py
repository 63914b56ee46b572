"""The parameters of an XDD's ApplicationProcess: what an object's uniqueIDRef leads to.

Knows CiA 311's parameter and its data types. Does not know objects.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from dvtcli.domain.unit import parse_offset, parse_scale
from dvtcli.files.eds.findings import Findings
from dvtcli.files.xdd.xdd_rules import PARAMETER_TWICE
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
#: A number is not longer than this.
_LONGEST = 40
#: What CiA 311 gives a parameter that has no access.
_DEFAULT_ACCESS = "ro"


@dataclass(frozen=True, slots=True)
class Parameter:
    """A *parameter* of the file; *element* is it, *template* the one that it takes its missing parts from."""

    element: XmlElement
    template: XmlElement | None = None

    @property
    def access(self) -> str:
        """The access type in the words of an EDS; empty for one that CANopen does not have."""
        given = self._attribute("access")
        return _DEFAULT_ACCESS if given is None else _ACCESS.get(given, "")

    @property
    def type_code(self) -> int | None:
        """The code of its data type, None where it is a type of the file's own, or none."""
        return next(
            (TYPES[element.name] for part in self._parts() for element in part.children if element.name in TYPES), None
        )

    @property
    def label(self) -> str:
        """What it is called, in English where the file has several languages."""
        return _label(self.element)

    @property
    def denotation(self) -> str:
        """What somebody called it in this device."""
        found = self._child("denotation")
        return "" if found is None else found.attributes.get("value") or _label(found) or found.text.strip()

    @property
    def unit(self) -> str:
        """The label of its unit; behind it what the file says of a scale where nobody can know which one counts."""
        label = self._unit_label
        return label if self._is_clear else f"{label} ({', '.join(self._scale_words)})".strip()

    @property
    def factor(self) -> str:
        """What its value and offset are multiplied by; empty for 1, and where it is not clear."""
        return next(iter(self._multipliers), "") if self._is_clear else ""

    @property
    def offset(self) -> str:
        """What is added to its value before it is multiplied; empty for 0, and where the scale is not clear."""
        return self._given_offset if self._is_clear else ""

    @property
    def _unit_label(self) -> str:
        found = self._child("unit")
        return "" if found is None else _label(found)

    @property
    def _multipliers(self) -> list[str]:
        """That of the parameter and that of its unit, without those that are 1."""
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
        """Whether one scale is said at most once, and by numbers: a label such as `1/256 V` is one, too."""
        numbers = [*map(_number, self._multipliers), *([_number(self._given_offset)] if self._given_offset else [])]
        if None in numbers or 0 in numbers or len(self._multipliers) > 1:
            return False
        return not numbers or parse_scale(self._unit_label)[0] == 1

    def value(self, name: str) -> str | None:
        """The value of *name* (`defaultValue`, `actualValue`), None where it has none."""
        found = self._child(name)
        return None if found is None else found.attributes.get("value")

    def limit(self, name: str) -> str | None:
        """`minValue` or `maxValue` of its one range; of several ranges none is a limit."""
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
            findings.add(PARAMETER_TWICE, element.line, f"parameter {name[:60]} stands twice; the first one counts")
            continue
        found[name] = Parameter(element, templates.get(element.attributes.get("templateIDRef", "")))
    return found


def _number(text: str) -> Fraction | None:
    """The number that *text* is, None where it is none."""
    try:
        return parse_offset(text)
    except ValueError:
        return None


def _label(element: XmlElement) -> str:
    """The English label, else the first one."""
    labels = element.all("label")
    best = next((label for label in labels if label.attributes.get("lang", "").lower().startswith("en")), None)
    chosen = best or (labels[0] if labels else None)
    text = "" if chosen is None else chosen.text.strip()
    return " ".join(text.split()) if "\n" in text else text
