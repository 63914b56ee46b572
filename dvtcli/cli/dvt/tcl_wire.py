"""What a Tcl script's process and ours say to each other: one JSON array a line, checked by whoever reads it.

Standard library only, since the script's process imports it. Knows neither Tcl nor the DVT's words.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import IO, Any, NamedTuple

#: No line is longer; a call's texts are bounded below it, as JSON writes a character in up to six bytes.
MOST_BYTES = 16 << 20
MOST_CHARACTERS = 1_000_000


class WireError(Exception):
    """What came is no frame that may come now."""


class Gone(Exception):
    """The other process closed its end."""


class Limits(NamedTuple):
    """How long a script may compute (s), how many Tcl commands it may run, how many bytes its process may take."""

    seconds: float
    steps: int
    memory_bytes: int


class Setup(NamedTuple):
    """First of all: the script's absolute path (empty: lines follow), the commands that are served, the `Limits`."""

    path: str
    names: tuple[str, ...]
    seconds: float
    steps: int
    memory_bytes: int


class Ready(NamedTuple):
    """The answer to `Setup`: why there is no Tcl, or the line of a command that never ends, or neither."""

    missing: str
    unclosed: int


class Go(NamedTuple):
    """The script may begin."""


class TclLine(NamedTuple):
    """A line, or several, that Tcl is to run now, after those before it."""

    text: str


class Call(NamedTuple):
    """The script calls a served command, at *line* of *file*; 0 and empty where that is not known."""

    name: str
    texts: tuple[str, ...]
    line: int
    file: str


class CallResult(NamedTuple):
    """What a call brought, or with *failed* why not."""

    failed: bool
    text: str


class End(NamedTuple):
    """The script, or what was typed, ended: `done`, `failed`, or stopped by a limit: `seconds`, `steps`, `memory`.

    *message* is Tcl's, of what was typed its result. What was typed may also be `open`: not run: more must follow.
    """

    how: str
    message: str
    line: int
    file: str


Frame = Setup | Ready | Go | TclLine | Call | CallResult | End
_KINDS: dict[str, type[Any]] = {kind.__name__: kind for kind in (Setup, Ready, Go, TclLine, Call, CallResult, End)}
#: What a field of each annotated type may be.
_FITS: dict[str, Callable[[Any], bool]] = {
    "str": lambda value: isinstance(value, str),
    "bool": lambda value: isinstance(value, bool),
    "int": lambda value: type(value) is int and 0 <= value < 1 << 62,
    "float": lambda value: type(value) in (int, float) and math.isfinite(value),
    "tuple[str, ...]": lambda value: isinstance(value, list) and all(isinstance(text, str) for text in value),
}


def encode(frame: Frame) -> bytes:
    """*frame* as one line."""
    return json.dumps([type(frame).__name__, *frame]).encode("ascii") + b"\n"


def decode(line: bytes, *kinds: type[Any]) -> Any:
    """The frame that *line* is, of one of *kinds*; WireError for anything else."""
    try:
        values = json.loads(line)
    except (ValueError, RecursionError) as wrong:
        raise WireError(f"no JSON: {wrong}") from wrong
    if not isinstance(values, list) or not values or not isinstance(values[0], str):
        raise WireError("no frame")
    name, *fields = values
    kind = _KINDS.get(name)
    if kind is None or kind not in kinds:
        raise WireError(f"{name[:40]!r} may not come now")
    wanted: dict[str, Any] = kind.__annotations__
    if len(fields) != len(wanted):
        raise WireError(f"{name} with {len(fields)} fields")
    for (field, annotation), value in zip(wanted.items(), fields, strict=True):
        if not _FITS[_named(annotation)](value):
            raise WireError(f"{name}.{field} is no {_named(annotation)}")
    return kind(*(tuple(value) if isinstance(value, list) else value for value in fields))


def _named(annotation: Any) -> str:
    """An annotation as it was written: `NamedTuple` keeps it as a forward reference."""
    return str(getattr(annotation, "__forward_arg__", annotation))


def send(stream: IO[bytes], frame: Frame) -> None:
    """Write *frame* now; Gone where nobody reads any more."""
    try:
        stream.write(encode(frame))
        stream.flush()
    except OSError as closed:
        raise Gone from closed


def receive(stream: IO[bytes], *kinds: type[Any]) -> Any:
    """Wait for the next frame, of one of *kinds*; Gone at the stream's end, WireError for anything else."""
    line = stream.readline(MOST_BYTES + 1)
    if len(line) > MOST_BYTES:
        raise WireError(f"a line of more than {MOST_BYTES} bytes")
    if not line.endswith(b"\n"):
        raise Gone
    return decode(line, *kinds)
