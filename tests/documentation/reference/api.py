"""The public face of the package: what a program may use, with signatures, docstrings and fields."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Callable, Iterator
from typing import Any

import dvtcli
from dvtcli import results, testing
from tests.documentation.reference.markdown import cell, code, fenced, table


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
        own = [one for one in reversed(kind.__mro__) if one.__module__ == kind.__module__]
        members = [
            f"`{name}`" for one in own for name in vars(one) if not name.startswith("_") and _is_extra(one, name)
        ]
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
    answer = inspect.signature(inspect.unwrap(function)).return_annotation
    said = "" if answer is inspect.Signature.empty else f" -> {_plain(str(answer))}"
    return as_called(name, function, lambda one: _plain(str(one)), said)


def as_called(name: str, function: Any, shown: Callable[[inspect.Parameter], str], answer: str) -> list[str]:
    """*name* with its arguments, each as it is *shown*, and the *answer*; an argument a line where that is long."""
    parameters = [one for one in inspect.signature(inspect.unwrap(function)).parameters.values() if one.name != "self"]
    given = [shown(one) for one in parameters]
    named = [at for at, one in enumerate(parameters) if one.kind is one.KEYWORD_ONLY]
    if named and not any(one.kind is one.VAR_POSITIONAL for one in parameters):
        given.insert(named[0], "*")
    line = f"{name}({', '.join(given)}){answer}"
    return [line] if len(line) <= 100 else [f"{name}(", *(f"    {one}," for one in given), f"){answer}"]


def _plain(text: str) -> str:
    """A parameter without the rooms of its type, and without the quotes of a type that is text."""
    text = re.sub(r"\b(?:dvtcli|collections|pathlib|typing)(?:\.\w+)*\.(\w+)", r"\1", text)
    return re.sub(r"""^([*\w]+: )?(["'])(.*?)\2(?= =|$)""", r"\1\3", text)


def _prose(documented: Any) -> list[str]:
    text = inspect.cleandoc(documented.__doc__ or "")
    return re.sub(r"(?<![*\w])\*(\w+)\*(?![*\w])", r"`\1`", text).splitlines()
