"""List, set and remove aliases: the user's own words for lines of the prompt, in the user's settings file."""

from __future__ import annotations

import re
from pathlib import Path

from dvtcli.errors import UsageError
from dvtcli.files.settings_file import save_table
from dvtcli.files.user_folders import user_folder
from dvtcli.operations.results import Facts
from dvtcli.operations.user.settings import ALIASES, File, Settings
from dvtcli.operations.user.settings_search import user_file

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
        raise UsageError(f"your settings have no alias {name!r}", hint="the list of aliases has their names")
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
