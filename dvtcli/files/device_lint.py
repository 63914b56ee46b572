"""All rules over a file that describes a device, whichever format it has. Judges nothing itself."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

from dvtcli.files.eds.lint.linter import RULES
from dvtcli.files.eds.reader import EdsFile
from dvtcli.files.xdd.xdd_rules import XDD_RULES

if TYPE_CHECKING:
    from dvtcli.domain.profile import DeviceProfile
    from dvtcli.files.eds.findings import EdsFinding
    from dvtcli.files.xdd.xdd_reader import XddFile

#: Every rule there is.
EVERY_RULE = (*RULES, *XDD_RULES)
#: A finding, and its first and last column, 0 and 0 for none.
Placed = tuple["EdsFinding", tuple[int, int]]


def lint_device_file(
    file: EdsFile | XddFile, name: str, wanted: Collection[str], profile: DeviceProfile
) -> list[Placed]:
    """What the rules named in *wanted* say of *file*, called *name*, by line, as on a device of *profile*."""
    if isinstance(file, EdsFile):
        from dvtcli.files.eds.lint.finding_columns import Columns
        from dvtcli.files.eds.lint.linter import lint

        columns = Columns(file.text)
        return [(finding, columns.of(finding)) for finding in lint(file, name, wanted, profile)]
    from dvtcli.files.xdd.lint_xdd import lint_xdd

    return [(finding, (0, 0)) for finding in lint_xdd(file, name, wanted, profile)]
