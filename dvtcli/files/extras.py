"""Packages that dvtcli can do without: imported when first needed, with one clear error where they are missing."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from dvtcli.domain.hint import Hint, as_hint
from dvtcli.errors import UsageError
from dvtcli.version import DISTRIBUTION


def extra(package: str, name: str, purpose: str, instead: Hint | str = "") -> Any:
    """The *package* that comes with dvtcli's extra *name*; UsageError, with what goes *instead*, without it."""
    try:
        return import_module(package)
    except ModuleNotFoundError as missing:
        if missing.name is None or missing.name.partition(".")[0] != package.partition(".")[0]:
            raise
        top = package.partition(".")[0]
        hint = as_hint(f"pip install '{DISTRIBUTION}[{name}]'")
        hint = hint + instead if instead else hint
        raise UsageError(f"{purpose} needs {top}", hint=hint) from missing
