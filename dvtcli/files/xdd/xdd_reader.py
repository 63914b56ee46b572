"""XDD and XDC files (CiA 311): read them, and say what was odd.

`read_xdd` gives the same object dictionary as the EDS of the same device; objects are built when first looked at, and
findings when asked for. Refuses by name what is no CANopen description. Does not know devices, nor how a file is shown.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

from dvtcli.domain.object_dictionary import ObjectDictionary, OdObject
from dvtcli.files.eds.findings import EdsFinding, Findings
from dvtcli.files.input_file import read_input_head
from dvtcli.files.xdd.recognise import NAMESPACES, must_be_canopen
from dvtcli.files.xdd.xdd_device import read_device_info
from dvtcli.files.xdd.xdd_objects import build_object, number_of
from dvtcli.files.xdd.xdd_parameters import Parameter, read_parameters
from dvtcli.files.xdd.xdd_rules import OBJECT_LISTS, OBJECT_TWICE, OTHER_NAMESPACE
from dvtcli.files.xdd.xml_tree import MOST_BYTES, XmlElement, XmlTree, read_xml

_IDENTITY = 0x1018


@dataclass(frozen=True)
class XddFile:
    """A file that was read: its *dictionary*, the *tree* of its elements, and the elements of its objects by index.

    *first_findings* came up while the device was read; `findings` has all of them.
    """

    dictionary: ObjectDictionary
    tree: XmlTree
    objects: dict[int, XmlElement]
    parameters: dict[str, Parameter]
    first_findings: tuple[EdsFinding, ...]

    @property
    def node_id(self) -> int | None:
        """The node-ID of an XDC's deviceCommissioning, 1..127, or None."""
        return self.dictionary.info.node_id

    @property
    def sections(self) -> int:
        """How many elements describe objects and sub-indices."""
        lists = self.tree.root.anywhere("CANopenObjectList")
        return sum(
            1 + len(element.all("CANopenSubObject"))
            for object_list in lists
            for element in object_list.all("CANopenObject")
        )

    @property
    def understood(self) -> int:
        """How many of them are in the dictionary."""
        many = (len(entry.entries) for entry in self.dictionary.values())
        of_many = sum(1 for element in self.objects.values() if element.first("CANopenSubObject") is None)
        return len(self.objects) + sum(many) - of_many

    @cached_property
    def findings(self) -> tuple[EdsFinding, ...]:
        """Everything odd in the file, by line; this looks at every object and takes its time."""
        findings = Findings(list(self.first_findings))
        for index, element in self.objects.items():
            build_object(index, element, self.parameters, findings)
        return findings.in_order()


def read_xdd(path: Path) -> XddFile:
    """Read the XDD or XDC file at *path*.

    InputFileError where it is none, OSError where it cannot be read.
    """
    return parse_xdd(read_input_head(path, MOST_BYTES + 1), path.name)


def parse_xdd(data: bytes, source: str) -> XddFile:
    """Read the bytes of an XDD or XDC file; *source* is its name for messages.

    InputFileError, with the line, where it is none: no XML, with a document type, of another bus, or without objects.
    """
    tree = read_xml(data, source)
    must_be_canopen(tree, source)
    findings = Findings()
    if tree.namespace not in NAMESPACES:
        findings.add(OTHER_NAMESPACE, tree.root.line, f"namespace {tree.namespace[:80]!r}; read all the same")
    elements = _objects(tree.root, findings)
    parameters = read_parameters(tree.root, findings)
    build = partial(_build, elements, parameters)
    identity = build(_IDENTITY) if _IDENTITY in elements else None
    info = read_device_info(tree.root, identity, findings)
    objects: dict[int, OdObject | Callable[[], OdObject]] = {index: partial(build, index) for index in elements}
    return XddFile(ObjectDictionary(objects, info, source), tree, elements, parameters, tuple(findings.found))


def _build(elements: dict[int, XmlElement], parameters: dict[str, Parameter], index: int) -> OdObject:
    """Build an object when it is first looked at; its findings are collected by `XddFile.findings`."""
    return build_object(index, elements[index], parameters, Findings())


def _values(element: XmlElement) -> list[tuple[str, str]]:
    """The actual values of an object and its sub-indices, as they are written."""
    every = [element, *element.all("CANopenSubObject")]
    return [(item.attributes.get("subIndex", ""), item.attributes.get("actualValue", "").strip()) for item in every]


def _objects(root: XmlElement, findings: Findings) -> dict[int, XmlElement]:
    """The objects of the first list, by index."""
    first, *others = root.anywhere("CANopenObjectList")
    for other in others:
        text = f"a list of objects stands in line {first.line} too; this one is left out"
        findings.add(OBJECT_LISTS, other.line, text)
    found: dict[int, XmlElement] = {}
    for element in first.all("CANopenObject"):
        index = number_of(element, "index", 0xFFFF, findings)
        if index is None:
            continue
        if index in found:
            text = f"{index:04X} stands in line {found[index].line} too; that one counts"
            is_lost = _values(element) != _values(found[index])
            findings.add(OBJECT_TWICE, element.line, text, value_lost=is_lost, value_unread=True)
            continue
        found[index] = element
    return found
