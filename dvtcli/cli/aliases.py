"""The words of `[aliases]` at the prompt; an untrusted file must not redefine other words."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from dvtcli.cli.catalogue import command_names
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.domain.hint import Hint
    from dvtcli.operations.user.settings import Settings

#: Common words of other programs: an untrusted alias must not change their meaning.
_COMMON = frozenset(
    {
        "about", "alias", "apt", "awk", "bash", "bg", "bye", "cal", "calc", "call", "candump", "cansend", "cat", "cd",
        "chmod", "chown", "clear", "close", "cls", "cmd", "commit", "config", "configure", "connect", "copy", "cp",
        "curl", "cut", "date", "dd", "debug", "del", "delete", "detach", "dir", "disconnect", "dmesg", "docker", "dump",
        "echo", "edit", "emacs", "end", "env", "erase", "exec", "fg", "file", "find", "format", "get", "git", "grep",
        "halt", "head", "hello", "hi", "history", "id", "ifconfig", "info", "init", "install", "ip", "jobs", "kill",
        "less", "list", "ll", "logout", "ls", "lsusb", "make", "man", "mkdir", "modprobe", "more", "mount", "move",
        "mv", "nano", "network", "new", "nodes", "off", "ok", "on", "open", "options", "pause", "ping", "pip",
        "poweroff", "print", "ps", "put", "pwd", "python", "q", "query", "quit", "reboot", "redo", "refresh", "reload",
        "remove", "rename", "reset", "resume", "rm", "rmdir", "sed", "settings", "setup", "sh", "shell", "show",
        "shutdown", "sleep", "sort", "source", "ssh", "start", "stat", "state", "status", "stop", "su", "sudo",
        "suspend", "tail", "tar", "tee", "test", "time", "top", "touch", "tty", "type", "uname", "unset", "up",
        "update", "upload", "uptime", "usage", "ver", "version", "vi", "view", "vim", "w", "wc", "wget", "what",
        "where", "which", "who", "whoami", "write", "x", "y", "yes", "n", "no",
    }
)  # fmt: skip
_A_PDO = re.compile(r"(?i)(?:\d{1,3}:)?[tr]pdo\d{0,3}")


def usable_aliases(settings: Settings) -> dict[str, str]:
    """Return the usable aliases. Raises UsageError if a trusted file's alias would hide a command."""
    found: dict[str, str] = {}
    for file in settings.files:
        if file.trusted:
            hidden = sorted(word for word in file.aliases if word.lower() in command_names())
            if hidden:
                raise UsageError(
                    f"{file.path}: the alias {hidden[0]!r} is a command already", hint="rename it in [aliases]"
                )
            found |= file.aliases
    withheld = _withheld(settings)
    if settings.project is not None and not settings.project.trusted:
        found |= {word: text for word, text in settings.project.aliases.items() if word not in withheld}
    return found


def withheld_aliases(settings: Settings) -> Hint | None:
    """Return the warning about aliases ignored for lack of trust; None if all are usable."""
    withheld = _withheld(settings)
    if not withheld or settings.project is None:
        return None
    commands = [word for word in withheld if word.lower() in command_names()]
    others = [word for word in withheld if word not in commands]
    said: list[Hint] = []
    if others:
        why = "an alias with | or >, with --yes or --force, or with the name of a common word, needs a trusted file"
        said.append(settings.untrusted(f"{_words(others)} not count: {why}"))
    if commands:
        from dvtcli.domain.hint import as_hint

        what = "the name of a command" if len(commands) == 1 else "names of commands"
        said.append(as_hint(f"{settings.project.path}: {_words(commands)} not count: rename aliases that are {what}"))
    return said[0] if len(said) == 1 else said[0] + "; " + said[1]


def _words(words: list[str]) -> str:
    return f"{', '.join(words)} in [aliases] {'does' if len(words) == 1 else 'do'}"


def _withheld(settings: Settings) -> list[str]:
    project = settings.project
    if project is None or project.trusted:
        return []
    own = settings.user.aliases if settings.user is not None else {}
    return [word for word, text in project.aliases.items() if word in own or _misleads(word, text)]


def _misleads(word: str, text: str) -> bool:
    """Whether *word* has a common other meaning, or its line contains redirections, --yes or --force."""
    from dvtcli.cli.dvt.words import WORDS

    known = word.lower()
    return (
        any(sign in text for sign in "|>")
        or any(map(_answers, re.sub(r"[\"'\\{}\[\]]", "", text.lower()).split()))
        or known in _COMMON
        or known in command_names()
        or known in {name.lower() for name in WORDS}
        or _A_PDO.fullmatch(known) is not None
    )


def _answers(option: str) -> bool:
    """Whether *option* is, or is short for, --yes or --force; also among other letters, as in `-qy`."""
    name = option.partition("=")[0]
    if name.startswith("--"):
        return len(name) > 2 and any(full.startswith(name) for full in ("--yes", "--force"))
    return re.match(r"-[a-z]*y", name) is not None
