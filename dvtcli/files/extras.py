"""Packages that dvtcli can do without: imported when first needed, with one clear error where they are missing."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from dvtcli.domain.hint import Hint, as_hint
from dvtcli.errors import UsageError
from dvtcli.version import DISTRIBUTION


def require(package: str, name: str, purpose: str, instead: Hint | str = "") -> None:
    """UsageError, with what goes *instead*, without the *package* that comes with dvtcli's extra *name*."""
    if find_spec(package) is None:
        raise _missing(package, name, purpose, instead)


def extra(package: str, name: str, purpose: str) -> Any:
    """The *package* that comes with dvtcli's extra *name*; UsageError without it."""
    try:
        return import_module(package)
    except ModuleNotFoundError as missing:
        top = package.partition(".")[0]
        if missing.name is None or missing.name.partition(".")[0] != top:
            raise
        raise _missing(top, name, purpose) from missing


def _missing(package: str, name: str, purpose: str, instead: Hint | str = "") -> UsageError:
    hint = as_hint(f"pip install '{DISTRIBUTION}[{name}]'")
    return UsageError(f"{purpose} needs {package}", hint=hint + instead if instead else hint)
