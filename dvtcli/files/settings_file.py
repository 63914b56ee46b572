"""Read and write a settings file, `dvtcli.toml` or `config.toml`, as TOML of the right types."""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from dvtcli.errors import InputFileError

Setting = str | int | list[str]


def with_settings(text: str, settings: Mapping[str, Setting]) -> str:
    """Return *text* with *settings* at its top level. Raises ValueError if the rest would change."""
    wanted = {**tomllib.loads(text), **settings}
    lines = text.splitlines()
    for key, value in settings.items():
        _set(lines, key, f"{key} = {json.dumps(value, ensure_ascii=False)}")
    result = "\n".join([*lines, ""])
    if tomllib.loads(result) != wanted:
        raise ValueError("its keys are written over several lines")
    return result


def _set(lines: list[str], key: str, line: str) -> None:
    """Replace the line of *key*, or add *line* before the first table."""
    table = next((number for number, old in enumerate(lines) if old.lstrip().startswith("[")), len(lines))
    for number, old in enumerate(lines[:table]):
        if re.match(rf"\s*{re.escape(key)}\s*=", old):
            lines[number] = line
            return
    lines.insert(table, line)


def with_table(text: str, name: str, table: Mapping[str, Setting]) -> str:
    """Return *text* with the table [*name*] as *table*, left out if empty. Raises ValueError if the rest would change.

    The lines of keys that stay are kept, with their comments.
    """
    before = tomllib.loads(text)
    wanted = {key: value for key, value in before.items() if key != name} | ({name: dict(table)} if table else {})
    lines = text.splitlines()
    header = re.compile(rf"\s*\[\s*{re.escape(name)}\s*\]\s*(#.*)?")
    begin = next((number for number, line in enumerate(lines) if header.fullmatch(line)), len(lines))
    after = range(begin + 1, len(lines))
    end = next((number for number in after if lines[number].lstrip().startswith("[")), len(lines))
    kept = _kept_lines(lines[begin + 1 : end], before.get(name, {}), table)
    new = [f"{json.dumps(key, ensure_ascii=False)} = {json.dumps(value, ensure_ascii=False)}" for key, value in
           table.items() if before.get(name, {}).get(key) != value]  # fmt: skip
    head = lines[begin : begin + 1] or [*([""] if lines and lines[-1] else []), f"[{name}]"]
    result = "\n".join([*lines[:begin], *([*head, *kept, *new] if table else []), *lines[end:], ""])
    if tomllib.loads(result) != wanted:
        raise ValueError(f"the table [{name}] is written in another way than a key a line")
    return result


def _kept_lines(lines: list[str], before: Mapping[str, Any], table: Mapping[str, Setting]) -> list[str]:
    """Return *lines* without those of keys that *table* has no more or with another value."""
    kept: list[str] = []
    for line in lines:
        try:
            keys = tomllib.loads(line)
        except tomllib.TOMLDecodeError:
            keys = {}
        if all(table.get(key) == before.get(key) for key in keys):
            kept.append(line)
    return kept


def save_settings(path: Path, settings: Mapping[str, Setting]) -> None:
    """Write *settings* into the file *path*. Raises InputFileError if the file cannot take them."""
    _save(path, lambda text: with_settings(text, settings))


def save_table(path: Path, name: str, table: Mapping[str, Setting]) -> None:
    """Write the table [*name*] into the user's file *path*. Raises InputFileError if the file cannot take it."""
    _save(path, lambda text: with_table(text, name, table))


def _save(path: Path, changed: Callable[[str], str]) -> None:
    try:
        text = path.read_text("utf-8") if path.exists() else ""
        written = changed(text)
        path.parent.mkdir(parents=True, exist_ok=True)
        # a file that others could write would not be taken, whatever the umask says
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644), "w", encoding="utf-8") as file:
            file.write(written)
    except (OSError, ValueError) as failed:
        raise InputFileError(f"{path}: not saved: {failed}", place=str(path)) from failed


#: Maximum size of a settings file (bytes), normally a few lines.
MOST_BYTES = 100_000
_ALIASES_HINT = '[aliases]  then  v = "read 606C"'


def parsed(data: bytes, path: str) -> dict[str, Any]:
    """Return the keys in *data*, with `-` as `_`. Raises InputFileError, naming *path*, for bad or oversized TOML."""
    if len(data) > MOST_BYTES:
        raise InputFileError(f"{path}: more than {MOST_BYTES} bytes are no settings", place=path)
    try:
        return _plain(tomllib.loads(data.decode()))
    except (ValueError, RecursionError) as wrong:  # no TOML, no UTF-8, a number of 5000 digits, too deep a nest
        raise InputFileError(f"{path}: not valid TOML: {wrong}", place=path) from wrong


def _plain(table: Mapping[str, Any]) -> dict[str, Any]:
    return {key.replace("-", "_"): value for key, value in table.items()}


def aliases(found: Any, path: str) -> dict[str, str]:
    """Return the table `[aliases]`: words and the beginnings of lines they expand to. Raises InputFileError."""
    if not isinstance(found, dict):
        raise InputFileError(f"{path}: aliases is a table", place=path, hint=_ALIASES_HINT)
    for word, text in found.items():
        if not re.fullmatch(r"[\w.-]+", word) or not isinstance(text, str) or not text.strip() or "\n" in text:
            raise InputFileError(
                f"{path}: the alias {word!r} is not one word that stands for one line", place=path, hint=_ALIASES_HINT
            )
    return found


def transmit_lists(found: Any, path: str) -> dict[str, list[str]]:
    """Return the table `[transmit]`: for each bus the rows of its transmit list. Raises InputFileError."""
    if not isinstance(found, dict) or not all(
        isinstance(rows, list) and all(map(_is_text, rows)) for rows in found.values()
    ):
        raise InputFileError(f"{path}: transmit is a table of lists of texts", place=path)
    return found


def tables(found: Any, path: str) -> dict[str, dict[str, Any]]:
    """Return the tables `[bus.NAME]`, by name. Raises InputFileError if `bus` is anything else."""
    if not isinstance(found, dict) or not all(isinstance(table, dict) for table in found.values()):
        from dvtcli.domain.hint import Action, Hint

        raise InputFileError(
            f"{path}: bus is not a table of tables",
            place=path,
            hint='[bus.bench]  then  interface = "socketcan"  and  channel = "can0"'
            + Hint(Action.GIVE_BUS, {"bus": "bench"}, ";  {} chooses it"),
        )
    return {name: _plain(table) for name, table in found.items()}


def value_of(key: str, value: Any, default: object, path: str, *, repeated: bool) -> Any:
    """Convert the *value* of an option with *default*; for a *repeated* option always to a list.

    `bus_kwargs` may be a table. Raises InputFileError for another type.
    """
    if key == "bus_kwargs" and isinstance(value, dict):
        value = _pairs(value, path)
    if not repeated:
        right, kinds = _fits(default, value)
        if not right:
            raise InputFileError(f"{path}: {key} is {kinds}", place=path)
        return value
    values = [value] if isinstance(value, str) else value
    if not isinstance(values, list) or not all(map(_is_text, values)):
        raise InputFileError(f"{path}: {key} is a text or a list of texts", place=path)
    return values


def _pairs(table: Mapping[str, Any], path: str) -> list[str]:
    """Convert the table `[bus_kwargs]` to the form of `--bus-kwargs`."""
    for key, value in table.items():
        if not isinstance(value, str | bool) and not _is_number(value):
            raise InputFileError(f"{path}: bus_kwargs.{key} is a text, a number, true or false", place=path)
    return [f"{key}={str(value).lower() if isinstance(value, bool) else value}" for key, value in table.items()]


def _fits(default: object, value: Any) -> tuple[bool, str]:
    """Whether *value* has a type for an option with *default*, and the allowed types."""
    if isinstance(default, bool):
        return isinstance(value, bool), "true or false"
    if type(default) is int:
        return type(value) is int and 0 <= value < 10, "a number, 0…9"
    return _is_number(value) or _is_text(value), "a text or a number"


def _is_number(value: Any) -> bool:
    """Whether *value* is finite and below 5000 digits, which Python refuses to print."""
    return type(value) in (int, float) and abs(value) < 1 << 64


def _is_text(value: Any) -> bool:
    """Whether *value* is a text that can be a path or a name."""
    return isinstance(value, str) and "\0" not in value
