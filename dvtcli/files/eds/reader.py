"""EDS and DCF files (CiA 306): read them whatever their tool made of the standard, and say what was odd.

`read_eds` gives an object dictionary at once; objects are built when first looked at, and findings when asked
for. Nothing is dropped in silence: a section is understood or a finding says that it was not, and the text of
all stays in `EdsFile.text` with its lines. Does not know devices, nor XML descriptions, nor modules.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from pathlib import Path

from dvtcli.domain.object_dictionary import ObjectDictionary, OdObject
from dvtcli.errors import InputFileError
from dvtcli.files.eds.bounds import MOST_BYTES, too_much
from dvtcli.files.eds.compact import compact_pdo_indices, compact_pdo_object
from dvtcli.files.eds.device_sections import check_lists, read_device_info
from dvtcli.files.eds.findings import EdsFinding, Findings
from dvtcli.files.eds.ini import IniText, IniValue, Values, section_values, split_sections
from dvtcli.files.eds.keys import number_key
from dvtcli.files.eds.layout import EdsLayout, lay_out, report_repeated, report_stray
from dvtcli.files.eds.object_sections import build_object
from dvtcli.files.eds.read_rules import COMPACT_PDO, COMPACT_PDO_BITS
from dvtcli.files.input_file import read_input_head

__all__ = ["EdsFile", "EdsFinding", "parse_eds", "read_eds"]

_IDENTITY = 0x1018
_PDO_SUB_INDICES = 0x3F


@dataclass(frozen=True)
class EdsFile:
    """A file that was read: its *dictionary*, and everything it says as *text* (sections in its order, with lines).

    *first_findings* came up while the device sections were read; `findings` has all of them.
    """

    dictionary: ObjectDictionary
    text: IniText
    layout: EdsLayout
    first_findings: tuple[EdsFinding, ...]

    @property
    def node_id(self) -> int | None:
        """The node-ID of a DCF's DeviceComissioning, 1..127, or None."""
        return self.dictionary.info.node_id

    @property
    def sections(self) -> int:
        """How many sections the file has."""
        return len(self.text.sections)

    @property
    def understood(self) -> int:
        """How many of them were understood; a finding of rule `section-not-understood` names each of the others."""
        return self.sections - len(self.layout.stray)

    @cached_property
    def findings(self) -> tuple[EdsFinding, ...]:
        """Everything odd in the file, by line; this looks at every section and takes its time."""
        findings = Findings(list(self.first_findings))
        section_values([self.text.preamble], findings)
        report_stray(self.layout, findings)
        report_repeated(self.layout.device.values(), findings)
        for name in ("fileinfo", "comments"):
            section_values(self.layout.device.get(name, ()), findings)
        check_lists(self.layout, findings)
        for index in self.layout.objects:
            build_object(self.layout, index, findings)
        return findings.in_order()

    @property
    def lacks_to_its_end(self) -> str:
        """Where the file ends too early, what it lacks: the last objects that its lists name; empty where it does not.

        The last by the lists, or by the index: sections stand in either order.
        """
        listed = check_lists(self.layout, Findings())
        lacking = set(listed) - self.layout.objects.keys()
        if not listed or lacking.isdisjoint({listed[-1], max(listed)}):
            return ""
        return f"{len(lacking)} of {len(listed)} objects that its lists name have no section, to the last one"

    def values(self, section: str) -> Mapping[str, IniValue]:
        """The keys (in lower case) of every part of *section*, known or not, with value and line; empty if absent."""
        wanted = section.strip().lower()
        parts = [part for part in self.text.sections if part.name.lower() == wanted]
        return section_values(parts, Findings())


def read_eds(path: Path) -> EdsFile:
    """Read the EDS or DCF file at *path*.

    InputFileError where it is none, OSError where it cannot be read.
    """
    return parse_eds(read_input_head(path, MOST_BYTES + 1), path.name)


def parse_eds(data: bytes, source: str) -> EdsFile:
    """Read the bytes of an EDS or DCF file; *source* is its name for messages.

    InputFileError where it is none: no section of an EDS in it, or more than any device describes.
    """
    return _parsed(data, source)


#: the nodes of a machine often have copies of one file, and a session reads its files with each command
@lru_cache(maxsize=8)
def _parsed(data: bytes, source: str) -> EdsFile:
    if excess := too_much(data):
        raise InputFileError(f"{source} is {excess}", place=f"{source}:1", why="an EDS or DCF is some 100 kB")
    text = split_sections(data)
    layout = lay_out(text)
    if not layout.recognised:
        raise _not_an_eds(data, source)
    findings = Findings()
    device = section_values(layout.device.get("deviceinfo", ()), findings)
    identity = _build(layout, _IDENTITY) if _IDENTITY in layout.objects else None
    info = read_device_info(device, layout, identity, findings)
    objects: dict[int, OdObject | Callable[[], OdObject]] = {
        index: partial(_build, layout, index) for index in layout.objects
    }
    objects |= _compact_pdos(device, set(objects), info.rpdo_count or 0, info.tpdo_count or 0, findings)
    return EdsFile(ObjectDictionary(objects, info, source), text, layout, tuple(findings.found))


def _build(layout: EdsLayout, index: int) -> OdObject:
    """Build an object when it is first looked at; its findings are collected by `EdsFile.findings`."""
    return build_object(layout, index, Findings())


def _compact_pdos(
    device: Values, present: set[int], rpdo_count: int, tpdo_count: int, findings: Findings
) -> dict[int, Callable[[], OdObject]]:
    mask = number_key(device, "compactpdo", 0, 0xFF, findings)
    if not mask:
        return {}
    line = device["compactpdo"].line
    if mask & ~_PDO_SUB_INDICES:
        findings.add(COMPACT_PDO_BITS, line, f"CompactPDO=0x{mask:02X}: bits above 5 have no meaning; ignored")
    missing = compact_pdo_indices(present, rpdo_count, tpdo_count)
    if missing:
        text = f"CompactPDO: {len(missing)} PDO parameters without a section exist as CiA 301 describes them"
        findings.add(COMPACT_PDO, line, text)
    return {index: partial(compact_pdo_object, index, mask & _PDO_SUB_INDICES, line) for index in missing}


def _not_an_eds(data: bytes, source: str) -> InputFileError:
    if not data.strip():
        why = "the file is empty"
    elif b"\0" in data[:4096]:
        why = "it looks like binary data"
    elif data.lstrip()[:1] == b"<":
        why = "it looks like XML (XDD/XDC?)"
    else:
        why = "it has no section such as [DeviceInfo] or [1000]"
    return InputFileError(f"{source} is not an EDS or DCF file", place=f"{source}:1", why=why)
