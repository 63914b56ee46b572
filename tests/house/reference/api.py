"""The public face of the package: what a program may use, with signatures, docstrings and fields."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Iterator
from typing import Any

import dvtcli
from dvtcli import results, testing
from tests.house.reference.markdown import cell, code, fenced, table


def calls() -> Iterator[str]:
    """Functions and classes with their methods, in the order of the package's own list."""
    for name in (
        "connect", "simulate", "profiles", "profile", "check_eds", "eds_library", "add_eds", "convert", "report"
    ):  # fmt: skip
        yield from _function(name, getattr(dvtcli, name), "dvtcli.")
    for name in ("Bus", "Node", "Lss"):
        kind = getattr(dvtcli, name)
        yield from ("", f"### {name}", "", *_prose(kind))
        for member, value in ((name, value) for one in reversed(kind.__mro__) for name, value in vars(one).items()):
            if member.startswith("_"):
                continue
            if isinstance(value, property):
                yield from ("", f"#### {name}.{member}", "", *_prose(value))
            else:
                yield from _function(member, value, f"{name}.", level=4)
    yield from _options()


def _options() -> Iterator[str]:
    from dvtcli.operations.api.arguments import PdoOptions

    source = inspect.getsource(PdoOptions)
    rows = re.findall(r"#: (.+)\n    (\w+): (.+)", source)
    yield from ("", "### Options of map and set", "")
    yield from table(("name", "type", "sense"), ((code(name), code(kind), cell(sense)) for sense, name, kind in rows))


def answers() -> Iterator[str]:
    """What calls answer and tell: each class with its fields."""
    for name in results.__all__:
        kind = getattr(results, name)
        yield from ("", f"### results.{name}", "", *_prose(kind))
        if dataclasses.is_dataclass(kind):
            rows = ((code(field.name), code(str(field.type))) for field in dataclasses.fields(kind))
            yield from ("", *table(("field", "type"), rows))
        members = [f"`{member}`" for member in vars(kind) if not member.startswith("_") and _is_extra(kind, member)]
        if members:
            yield from ("", f"Also {', '.join(members)}.")


def _is_extra(kind: Any, member: str) -> bool:
    return isinstance(vars(kind)[member], property | classmethod) or inspect.isfunction(vars(kind)[member])


def fixtures() -> Iterator[str]:
    """The fixtures and helpers for pytest."""
    for name in testing.__all__:
        value = getattr(testing, name)
        if inspect.isclass(value):
            yield from ("", f"### testing.{name}", "", *_prose(value))
            yield from _members(value)
        elif name.startswith("dvtcli_"):
            yield from ("", f"### {name}", "", *_prose(value))
        else:
            yield from _function(name, value, "testing.")


def _members(kind: type) -> Iterator[str]:
    """The fields of a class, then its properties and methods, each with its sentence; or how it is called."""
    if dataclasses.is_dataclass(kind):
        rows = ((code(field.name), code(str(field.type))) for field in dataclasses.fields(kind))
        yield from ("", *table(("field", "type"), rows))
    for name, value in vars(kind).items():
        if name == "__call__":
            yield from ("", *fenced("text", _signature("", value)))
        elif isinstance(value, property):
            yield from ("", f"#### {kind.__name__}.{name}", "", *_prose(value))
        elif inspect.isfunction(value) and not name.startswith("_"):
            yield from _function(name, value, f"{kind.__name__}.", level=4)


def _function(name: str, function: Any, prefix: str, level: int = 3) -> Iterator[str]:
    yield from ("", f"{'#' * level} {prefix}{name}", "")
    yield from fenced("text", _signature(name, function))
    yield from ("", *_prose(function))


def _signature(name: str, function: Any) -> list[str]:
    """How it is called, in one line where that is short."""
    whole = inspect.signature(inspect.unwrap(function))
    shown = [_plain(str(one)) for one in whole.parameters.values() if one.name != "self"]
    star = next((at for at, one in enumerate(whole.parameters.values()) if one.kind is one.KEYWORD_ONLY), None)
    if star is not None and not any(one.kind is one.VAR_POSITIONAL for one in whole.parameters.values()):
        shown.insert(star - ("self" in whole.parameters), "*")
    answer = "" if whole.return_annotation is whole.empty else f" -> {_plain(str(whole.return_annotation))}"
    line = f"{name}({', '.join(shown)}){answer}"
    return [line] if len(line) <= 100 else [f"{name}(", *(f"    {one}," for one in shown), f"){answer}"]


def _plain(text: str) -> str:
    """A parameter without the rooms of its type, and without the quotes of a type that is text."""
    text = re.sub(r"\b(?:dvtcli|collections|pathlib|typing)(?:\.\w+)*\.(\w+)", r"\1", text)
    return re.sub(r"""^([*\w]+: )?(["'])(.*?)\2(?= =|$)""", r"\1\3", text)


def _prose(documented: Any) -> list[str]:
    text = inspect.cleandoc(documented.__doc__ or "")
    return re.sub(r"(?<![*\w])\*(\w+)\*(?![*\w])", r"`\1`", text).splitlines()
