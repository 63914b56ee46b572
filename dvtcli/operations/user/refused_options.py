"""Refuse options that would have no effect."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dvtcli.domain.hint import Hint


def refuse_options(options: Mapping[str, object], text: str, hint: Hint | str | None = None) -> None:
    """Raise UsageError with *text* for those of *options*, by name, that are given: not None, false or empty."""
    given = {name: None for name, value in options.items() if value is not None and value is not False and value != ()}
    if given:
        raise UsageError(text, given=given, hint=hint)
