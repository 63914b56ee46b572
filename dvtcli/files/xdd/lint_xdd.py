"""Apply all rules to an XDD or XDC: findings of the reader, and rules about the described device.

Findings get their line; their text names the object and its data type. Rules about an EDS's text do not apply.
"""

from __future__ import annotations

from collections.abc import Collection

from dvtcli.domain.lint.described import DescribedDevice, Spot, object_text
from dvtcli.domain.profile import GENERIC, DeviceProfile
from dvtcli.files.eds.findings import EdsFinding
from dvtcli.files.eds.lint.linted_text import named
from dvtcli.files.eds.lint.linter import DEVICE_CHECKS
from dvtcli.files.xdd.xdd_reader import XddFile


def lint_xdd(
    file: XddFile, name: str, wanted: Collection[str], profile: DeviceProfile = GENERIC
) -> tuple[EdsFinding, ...]:
    """Return findings of the rules *wanted* in *file*, named *name*, by line.

    PDOs are checked as on a device of *profile*.
    """
    objects = _objects_by_line(file)
    found = [finding for finding in file.findings if finding.rule in wanted]
    any_node = file.node_id is None
    configured = name.lower().endswith(".xdc") or not any_node
    device = DescribedDevice(file.dictionary, file.node_id or 1, configured, any_node, profile)
    for check in DEVICE_CHECKS:
        if check.rule.name in wanted:
            found += (
                EdsFinding(_line(file, spot), check.rule.severity, check.rule.name, said, spot.object)
                for spot, said in check.look(device)
            )
    told = dict.fromkeys(
        named(finding, finding.object or objects.get(finding.line, ""), file.dictionary) for finding in found
    )
    return tuple(sorted(told, key=lambda finding: finding.line))


def _objects_by_line(file: XddFile) -> dict[int, str]:
    """Return the object of each line; the first, if a line has several."""
    found: dict[int, str] = {}
    for index in file.dictionary:
        held = file.dictionary[index]
        if held.line is not None:
            found.setdefault(held.line, object_text(index, None))
        for entry in held.entries.values():
            if entry.line is not None:
                found.setdefault(entry.line, object_text(index, entry.sub_index))
    return found


def _line(file: XddFile, spot: Spot) -> int:
    """Return the line of *spot*: of its sub-index, else its object, else 1."""
    held = None if spot.index is None else file.dictionary.get(spot.index)
    if held is None:
        return 1
    entry = None if spot.sub_index is None else held.entries.get(spot.sub_index)
    return (None if entry is None else entry.line) or held.line or 1
