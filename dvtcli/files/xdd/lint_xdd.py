"""The rules over one XDD or XDC: what the reader met, and what the described device has.

Gives each finding its line, and the object with its data type in its text. Judges nothing itself. The rules about an
EDS's text have nothing to look at here.
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
    """Everything that the rules named in *wanted* say of *file*, which is called *name*, by line.

    Its PDOs are judged as on a device of that *profile*.
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
    """The object that the element of a line describes; of several in one line the first."""
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
    """The line of *spot*: its sub-index's, else its object's, else 1."""
    held = None if spot.index is None else file.dictionary.get(spot.index)
    if held is None:
        return 1
    entry = None if spot.sub_index is None else held.entries.get(spot.sub_index)
    return (None if entry is None else entry.line) or held.line or 1
