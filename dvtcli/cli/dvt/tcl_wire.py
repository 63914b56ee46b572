"""The protocol between dvtcli and a Tcl script's process: a JSON array per line, checked by the receiver.

Standard library only, since the script's process imports it.
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
    """The received data is not a frame allowed now."""


class Gone(Exception):
    """The other process closed its end."""


class Limits(NamedTuple):
    """Limits of a script: CPU time (s), number of Tcl commands, memory (bytes)."""

    seconds: float
    steps: int
    memory_bytes: int


class Setup(NamedTuple):
    """The first frame: the script's absolute path (empty: lines follow), served commands, `Limits`."""

    path: str
    names: tuple[str, ...]
    seconds: float
    steps: int
    memory_bytes: int


class Ready(NamedTuple):
    """The answer to `Setup`: why Tcl is missing, or the line of an unterminated command, or neither."""

    missing: str
    unclosed: int


class Go(NamedTuple):
    """The script may begin."""


class TclLine(NamedTuple):
    """One or more lines for Tcl to run now."""

    text: str


class Call(NamedTuple):
    """A script's call of a served command, at *line* of *file*; 0 and empty if unknown."""

    name: str
    texts: tuple[str, ...]
    line: int
    file: str


class CallResult(NamedTuple):
    """The result of a call, or the reason if *failed*."""

    failed: bool
    text: str


class End(NamedTuple):
    """The end of a script or typed line: `done`, `failed`, or a limit: `seconds`, `steps`, `memory`.

    *message* is Tcl's, or a typed line's result. A typed line may also be `open`: not run, more must follow.
    """

    how: str
    message: str
    line: int
    file: str


Frame = Setup | Ready | Go | TclLine | Call | CallResult | End
_KINDS: dict[str, type[Any]] = {kind.__name__: kind for kind in (Setup, Ready, Go, TclLine, Call, CallResult, End)}
#: The valid values of each annotated type.
_FITS: dict[str, Callable[[Any], bool]] = {
    "str": lambda value: isinstance(value, str),
    "bool": lambda value: isinstance(value, bool),
    "int": lambda value: type(value) is int and 0 <= value < 1 << 62,
    "float": lambda value: type(value) in (int, float) and math.isfinite(value),
    "tuple[str, ...]": lambda value: isinstance(value, list) and all(isinstance(text, str) for text in value),
}


def encode(frame: Frame) -> bytes:
    """Return *frame* as a line."""
    return json.dumps([type(frame).__name__, *frame]).encode("ascii") + b"\n"


def decode(line: bytes, *kinds: type[Any]) -> Any:
    """Return the frame in *line*, of *kinds*. Raises WireError for anything else."""
    try:
        values = json.loads(line)
    except (ValueError, RecursionError) as wrong:
        raise WireError(f"not JSON: {wrong}") from wrong
    if not isinstance(values, list) or not values or not isinstance(values[0], str):
        raise WireError("no frame")
    name, *fields = values
    kind = _KINDS.get(name)
    if kind is None or kind not in kinds:
        raise WireError(f"{name[:40]!r} is not allowed now")
    wanted: dict[str, Any] = kind.__annotations__
    if len(fields) != len(wanted):
        raise WireError(f"{name} with {len(fields)} fields")
    for (field, annotation), value in zip(wanted.items(), fields, strict=True):
        if not _FITS[_named(annotation)](value):
            raise WireError(f"{name}.{field} is no {_named(annotation)}")
    return kind(*(tuple(value) if isinstance(value, list) else value for value in fields))


def _named(annotation: Any) -> str:
    """Return an annotation as written: `NamedTuple` keeps a forward reference."""
    return str(getattr(annotation, "__forward_arg__", annotation))


def send(stream: IO[bytes], frame: Frame) -> None:
    """Write *frame* now. Raises Gone if the other end is closed."""
    try:
        stream.write(encode(frame))
        stream.flush()
    except OSError as closed:
        raise Gone from closed


def receive(stream: IO[bytes], *kinds: type[Any]) -> Any:
    """Wait for the next frame of *kinds*. Raises Gone at the stream's end, WireError for anything else."""
    line = stream.readline(MOST_BYTES + 1)
    if len(line) > MOST_BYTES:
        raise WireError(f"a line of more than {MOST_BYTES} bytes")
    if not line.endswith(b"\n"):
        raise Gone
    return decode(line, *kinds)
