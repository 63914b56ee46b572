"""Another system's standard library, seen by this project's code only: modules and names that are missing, or added.

Other packages see the real one: their makers try them on the other systems. Does not know any system.
"""

from __future__ import annotations

import builtins
import sys
from collections.abc import Mapping
from types import ModuleType
from typing import Any

#: whose imports are answered by the double
_OURS = frozenset({"dvtcli", "tests", "__main__"})
_DOUBLES = (
    "tests.elsewhere.double",
    "tests.elsewhere.windows",
    "tests.elsewhere.windows_files",
    "tests.elsewhere.macos",
)


class Facade(ModuleType):
    """*module* without the names in *absent*, and with those of *given*; what is set is set there, too."""

    def __init__(self, module: ModuleType, absent: frozenset[str], given: Mapping[str, object]) -> None:
        super().__init__(module.__name__)
        self.__dict__.update(_module=module, _absent=absent, **given)

    def __getattr__(self, name: str) -> Any:
        if name in self.__dict__["_absent"]:
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
        return getattr(self.__dict__["_module"], name)

    def __setattr__(self, name: str, value: object) -> None:
        setattr(self.__dict__["_module"], name, value)

    def __delattr__(self, name: str) -> None:
        delattr(self.__dict__["_module"], name)

    def __dir__(self) -> list[str]:
        return sorted({*dir(self.__dict__["_module"]), *self.__dict__} - self.__dict__["_absent"])


def be(missing: frozenset[str], modules: Mapping[str, ModuleType]) -> None:
    """From now on the modules in *missing* are not there, and *modules* are what their names bring."""
    usual = builtins.__import__

    def bring(
        name: str,
        variables: Mapping[str, object] | None = None,
        local: Mapping[str, object] | None = None,
        fromlist: tuple[str, ...] | None = (),
        level: int = 0,
    ) -> ModuleType:
        asker = str((variables or {}).get("__name__", ""))
        top = name.partition(".")[0]
        if level or asker.partition(".")[0] not in _OURS or asker in _DOUBLES:
            return usual(name, variables, local, fromlist or (), level)
        if top in missing:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        if top not in modules or (fromlist and name != top):
            return usual(name, variables, local, fromlist or (), level)
        if name != top:
            usual(name, variables, local, (), 0)
        return modules[top]

    builtins.__import__ = bring  # type: ignore[assignment]


def facade(name: str, absent: str = "", /, **given: object) -> Facade:
    """The module called *name* without the names in *absent* (with blanks between them), and with *given*."""
    if name not in sys.modules:
        __import__(name)
    return Facade(sys.modules[name], frozenset(absent.split()), given)
