"""Change the user's own settings: trust in a project's settings file, and aliases."""

from __future__ import annotations

import re
from collections.abc import Collection
from pathlib import Path

from dvtcli.errors import InputFileError, SafetyRefusal, UsageError
from dvtcli.files.settings_file import save_table
from dvtcli.files.user_folders import user_folder
from dvtcli.operations.results import Facts
from dvtcli.operations.user.settings import ALIASES, NAME, File, Settings, SettingsFile, project_file, user_file
from dvtcli.operations.user.trusted_settings import is_trusted, real_path, revoke, trust


def trust_settings(
    path: str | None = None, *, remove: bool = False, dry_run: bool = False, commands: Collection[str] = ()
) -> Facts:
    """Trust the settings file *path* until it changes; *remove* ends the trust.

    None is the project's file in force. *dry_run* changes nothing. Raises InputFileError if it is invalid or
    unreadable, or an alias would hide one of *commands*; SafetyRefusal if another user can write it, UsageError if
    there is none. A file to remove may be missing or invalid.
    """
    where = _where(path)
    file = _read(where, remove=remove)
    if file is not None and not remove:
        _refuse_hidden(file, commands)
    try:
        if remove or file is None:
            changed = revoke(where, dry_run=dry_run)
        else:
            changed = not is_trusted(file.digest)
            if not dry_run:
                trust(file.digest, file.path)
    except OSError as failed:
        why = failed.strerror or str(failed)
        raise UsageError(
            f"trust cannot be saved: {why}", hint="is the state folder on a disk that is full?"
        ) from failed
    rows = (
        ("file", where),
        ("sha256", None if file is None else file.digest),
        ("trusted", not remove),
        ("changed", changed),
        ("dry_run", dry_run),
        ("keys", [] if file is None else list(file.keys)),
        ("never_taken", [] if file is None else [name.replace("_", "-") for name in file.ignored]),
    )
    if remove or file is None:
        lines = [f"{where} is not trusted any more" if changed else f"{where} was not trusted"]
    else:
        lines = _lines(file, changed=changed)
    if dry_run:
        lines[0] += f" (dry run: nothing was {'removed' if remove else 'kept'})"
    return Facts("trust", rows, tuple(lines))


def _where(path: str | None) -> str:
    if path is not None:
        return real_path(path)
    found = project_file()
    if found is None:
        raise UsageError(f"there is no {NAME} here or above", hint="name the file")
    return real_path(found.path)


def _read(path: str, *, remove: bool) -> File | None:
    """Read the file at *path*; None if it is to be removed and unreadable."""
    try:
        return File(SettingsFile(path), users_own=False, believed=True)
    except (InputFileError, SafetyRefusal):
        if remove:
            return None
        raise


def _refuse_hidden(file: File, commands: Collection[str]) -> None:
    hidden = sorted(word for word in file.aliases if word.lower() in commands)
    if hidden:
        raise InputFileError(
            f"{file.path}: the alias {hidden[0]!r} is a command already",
            place=file.path,
            hint="rename it in [aliases], then trust the file",
        )


def _lines(file: File, *, changed: bool) -> list[str]:
    lines = [f"{file.path} is trusted until it changes{'' if changed else ', as before'}"]
    sets = [f"{name} = {_shown(value)}" for name, (value, _) in file.layer.items()]
    for bus, layer in file.buses.items():
        sets += [f"[bus.{bus}] {name} = {_shown(value)}" for name, (value, _) in layer.items()]
    sets += [f"alias {word} = {text}" for word, text in file.aliases.items()]
    lines += [f"  {line}" for line in sets]
    if file.ignored:
        lines.append(f"never taken from a project's file: {', '.join(file.ignored)}")
    return lines


def _shown(value: object) -> str:
    return " ".join(map(str, value)) if type(value) is tuple else str(value)


_WORD = re.compile(r"[\w.-]+")


def list_aliases(settings: Settings, usable: dict[str, str]) -> Facts:
    """List the *usable* aliases, each with its settings file."""
    files = {word: file.path for file in settings.files for word in file.aliases if word in usable}
    rows = [{"name": word, "line": line, "file": files[word]} for word, line in sorted(usable.items())]
    width = max(map(len, usable), default=0)
    lines = [f"{word:<{width}} = {line}" for word, line in sorted(usable.items())]
    text = tuple(lines) or ("no aliases; an example: alias v = read 606C",)
    return Facts("alias", (("aliases", rows), ("changed", False), ("dry_run", False)), text)


def set_alias(name: str, line: str | None, *, dry_run: bool) -> Facts:
    """Set the alias *name* to *line* in the user's settings file, or remove it (None); *dry_run* writes nothing.

    Raises UsageError if *name* is no word, or if there is no such alias to remove; InputFileError if the file cannot
    take it.
    """
    if not _WORD.fullmatch(name):
        raise UsageError(f"{name!r} is not one word: an alias has letters, digits, _, . and -")
    found = user_file()
    own = {} if found is None else dict(File(found, users_own=True).aliases)
    before = own.get(name)
    if line is None and before is None:
        raise UsageError(f"your settings have no alias {name!r}", hint="the list of aliases shows their names")
    wanted = {word: text for word, text in own.items() if word != name} | ({} if line is None else {name: line})
    path = str(user_folder("config") / "config.toml") if found is None else found.path
    changed = before != line
    if changed and not dry_run:
        save_table(Path(path), ALIASES, wanted)
    said = f"{name} is no longer an alias" if line is None else f"{name} = {line}"
    said += f" (in {path})" if changed else " already"
    rows = [] if line is None else [{"name": name, "line": line, "file": path}]
    text = said + (" (dry run: nothing was written)" if dry_run else "")
    return Facts("alias", (("aliases", rows), ("changed", changed), ("dry_run", dry_run)), (text,))
