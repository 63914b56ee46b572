"""Add the usual cause of an abort code to an error that ends a command. Loaded only after an error."""

from __future__ import annotations

from dvtcli.domain.abort_causes import usual_cause
from dvtcli.errors import DvtcliError, RuleError


def add_usual_cause(error: DvtcliError) -> None:
    """Give *error*, which ends a command, its abort code's usual cause as the hint if it has neither hint nor why."""
    is_unexplained = error.hint is None and error.why is None
    if is_unexplained and error.abort is not None and not isinstance(error, RuleError):
        error.hint = usual_cause(error.abort, error.place)
