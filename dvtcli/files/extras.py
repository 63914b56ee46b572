"""Optional packages: imported on first use, with a clear error if missing."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from dvtcli.domain.hint import Hint, as_hint
from dvtcli.errors import UsageError
from dvtcli.interpreter import how_to_install
from dvtcli.version import DISTRIBUTION


def require(package: str, name: str, purpose: str, instead: Hint | str = "") -> None:
    """Raise UsageError, with the alternative *instead*, if *package* of dvtcli's extra *name* is missing."""
    if find_spec(package) is None:
        raise _missing(package, name, purpose, instead)


def extra(package: str, name: str, purpose: str) -> Any:
    """Import *package* of dvtcli's extra *name*. Raises UsageError if missing."""
    try:
        return import_module(package)
    except ModuleNotFoundError as missing:
        top = package.partition(".")[0]
        if missing.name is None or missing.name.partition(".")[0] != top:
            raise
        raise _missing(top, name, purpose) from missing


def _missing(package: str, name: str, purpose: str, instead: Hint | str = "") -> UsageError:
    hint = as_hint(how_to_install(f"{DISTRIBUTION}[{name}]"))
    return UsageError(f"{purpose} needs {package}", hint=hint + instead if instead else hint)
