"""Packages that dvtcli can do without: imported when first needed, with one clear error where they are missing."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from dvtcli.errors import UsageError
from dvtcli.version import DISTRIBUTION


def extra(package: str, name: str, purpose: str, instead: str = "") -> Any:
    """The *package* that comes with dvtcli's extra *name*; UsageError, with what goes *instead*, without it."""
    try:
        return import_module(package)
    except ModuleNotFoundError as missing:
        if missing.name is None or missing.name.partition(".")[0] != package.partition(".")[0]:
            raise
        top = package.partition(".")[0]
        hint = f"pip install '{DISTRIBUTION}[{name}]'{f'; {instead}' if instead else ''}"
        raise UsageError(f"{purpose} needs {top}", hint=hint) from missing
