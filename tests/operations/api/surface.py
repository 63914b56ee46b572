"""The public surface as text: `python -m tests.operations.api.surface` writes what the code has now to `surface.txt`.

Every name with its arguments, their kinds, defaults and types, the fields of results and of errors. What is in that
file is a promise: a change of it is a change of the version, and has its line in the CHANGELOG.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import dvtcli
from dvtcli import errors, results, testing
from dvtcli.operations.api import arguments
from tests.documentation.reference.api import as_called

FROZEN = Path(__file__).with_name("surface.txt")
REWRITE = "python -m tests.operations.api.surface"
PLAIN = (bool, int, float, str, tuple)


def surface() -> str:
    """Every public name of the package, a room after the other."""
    parts: dict[str, Iterator[str]] = {
        "dvtcli": (line for name in sorted(dvtcli.__all__) for line in _function(name, getattr(dvtcli, name))),
        **{name: members(getattr(dvtcli, name)) for name in ("Bus", "Node", "Lss")},
        "arguments": _arguments(),
        **{f"errors.{kind.__name__}": _error(kind) for kind in error_kinds()},
        **{f"results.{name}": members(getattr(results, name)) for name in sorted(results.__all__)},
        "testing": (line for name in sorted(testing.__all__) for line in _function(name, getattr(testing, name))),
        "testing.ServedBus": members(testing.ServedBus),
    }
    return "\n".join("\n    ".join((name, *lines)) + "\n" for name, lines in parts.items())


def error_kinds() -> list[type[errors.DvtcliError]]:
    """Every error, in the order in which they are written."""
    return [kind for kind in vars(errors).values() if inspect.isclass(kind) and issubclass(kind, errors.DvtcliError)]


def members(kind: Any) -> Iterator[str]:
    """The fields of a class in their order, then what else it has, by name."""
    fields: list[str] = []
    if dataclasses.is_dataclass(kind):
        for field in dataclasses.fields(kind):
            fields.append(field.name)
            yield f"{field.name}: {field.type}{_default(field)}"
    elif issubclass(kind, tuple):
        fields = list(kind._fields)
        for name, type_ in kind.__annotations__.items():
            default = f" = {kind._field_defaults[name]!r}" if name in kind._field_defaults else ""
            yield f"{name}: {getattr(type_, '__forward_arg__', type_)}{default}"
    operators = ("__bool__", "__call__", "__contains__", "__enter__", "__getitem__", "__iter__", "__len__")
    for name in sorted({name for name in dir(kind) if not name.startswith("_")} | {*operators} & {*dir(kind)}):
        value = inspect.getattr_static(kind, name)
        if name in fields or (issubclass(kind, tuple) and hasattr(tuple, name)):
            continue
        if isinstance(value, property):
            yield f"{name} -> {inspect.signature(value.fget).return_annotation}"  # type: ignore[arg-type]
        elif callable(getattr(kind, name)):
            yield from _function(name, getattr(kind, name))


def _default(field: dataclasses.Field[Any]) -> str:
    """What a field is where nobody says it; `…` for what is made then."""
    if field.default is dataclasses.MISSING:
        return "" if field.default_factory is dataclasses.MISSING else " = …"
    return f" = {field.default!r}" if isinstance(field.default, (*PLAIN, type(None))) else " = …"


def _error(kind: type[errors.DvtcliError]) -> Iterator[str]:
    """What it is and how it ends a command, and the fields that its docstring names."""
    yield f"is a {kind.__mro__[1].__name__}"
    yield f"exit code {kind.exit_code}, {kind.slug}"
    own = {*vars(kind), *re.findall(r"self\.(\w+)", inspect.getsource(kind)), *inspect.signature(kind).parameters}
    yield from (name for name in re.findall(r"\*(\w+)\*", kind.__doc__ or "") if name in own)


def _arguments() -> Iterator[str]:
    """The kinds of arguments, as they are written, and the options of a PDO."""
    source = inspect.getsource(arguments)
    yield from re.findall(r"^(?:Object|Entry|Group) = .+$", source, re.M)
    yield from re.findall(r"^    (\w+: .+)$", inspect.getsource(arguments.PdoOptions), re.M)


def _function(name: str, value: Any) -> Iterator[str]:
    """How it is called, an argument a line where that is long; a fixture by what it gives."""
    if not (inspect.isroutine(value) or name.startswith("dvtcli_")):
        yield name
        return
    answer = inspect.signature(inspect.unwrap(value)).return_annotation
    yield from as_called(name, value, _parameter, f" -> {answer}")


def _parameter(one: inspect.Parameter) -> str:
    """An argument as it is written."""
    kinds: dict[object, str] = {one.VAR_POSITIONAL: "*", one.VAR_KEYWORD: "**"}
    stars = kinds.get(one.kind, "")
    return f"{stars}{one.name}: {one.annotation}" + ("" if one.default is one.empty else f" = {one.default!r}")


if __name__ == "__main__":
    FROZEN.write_text(surface(), encoding="utf-8")
    print(f"{FROZEN.name} rewritten: `git diff` shows what of the promise is another")
