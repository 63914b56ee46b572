"""A check of `doctor` that ended in an error."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.errors import DvtcliError
from dvtcli.operations.results.diagnosis import Check

if TYPE_CHECKING:
    pass


def failed(name: str, error: DvtcliError) -> Check:
    """The check *name* that ended in *error*."""
    why = f": {error.why}" if error.why else ""
    return Check(name, "FAIL", f"{error.text}{why}", error.hint, error.exit_code)
