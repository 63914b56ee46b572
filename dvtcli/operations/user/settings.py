"""Find settings files, check their owners, and merge them with options and variables by priority.

The order: option, DVTCLI_…, the project's dvtcli.toml (searched upward), the user's config.toml. A bus is replaced as a
whole. Everything else is left to python-can.
"""

from __future__ import annotations

import os
import re
import stat
import sys
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from dvtcli.device.change.private_file import replaceable, stranger, sudo_user
from dvtcli.errors import DvtcliError, InputFileError, SafetyRefusal, UsageError
from dvtcli.files.user_folders import user_folder
from dvtcli.operations.user.options import Options, checked, is_repeated

if TYPE_CHECKING:
    from dvtcli.domain.hint import Hint

#: The source of the bus if no option, variable or file chose it.
NOBODY = "nobody"
#: Values by option, each with its source.
Layer = dict[str, tuple[Any, str]]
#: Options that together choose a bus.
_SIMULATED = frozenset({"sim", "fault", "signal"})
_BUS = frozenset({"bus", "interface", "channel", "bitrate", "bus_kwargs"}) | _SIMULATED
#: The key that is no option: the passcode for `login`.
PASSCODE = "passcode"
#: The table of aliases at the prompt.
ALIASES = "aliases"
#: The table of transmit lists by bus.
TRANSMIT = "transmit"
#: What another's project must not set.
USERS_OWN = ("yes", "force", PASSCODE, "no_shell", TRANSMIT)
#: The mark of a URL as channel: some of pyserial's write any file.
_URL = "://"
#: Keys of drivers that name a library to load, and names of such files.
_LIBRARY_KEY, _LIBRARY_FILE = re.compile(r"(?i)dll|lib"), re.compile(r"(?i)\.(dll|so|dylib|pyd|ocx)\b")
#: Interfaces whose driver loads its library from the current folder, by python-can 4: on Windows `./WDT_DIO.dll`.
_LIBRARY_HERE = frozenset({"neousys"})
#: Options that choose the bus.
_CHOOSES_BUS = ("interface", "channel", "bus_kwargs", "bus")


def _reaches_further(pair: str) -> bool:
    """Tell whether a KEY=VALUE of a bus can make a driver open a URL or load a library."""
    key, _, value = pair.partition("=")
    return _URL in value or _LIBRARY_KEY.search(key) is not None or _LIBRARY_FILE.search(value) is not None


def laid_over(weaker: Layer, stronger: Layer) -> Layer:
    """Merge, *stronger* first: if it chooses a bus, the bus of *weaker* is dropped.

    A stronger channel, bit rate or further key alone changes the weaker bus, but a simulated node has no channel.
    """
    replaced: frozenset[str] = frozenset()
    if stronger.keys() & {"bus", "sim", "interface"}:
        replaced = _BUS
    elif "channel" in stronger:
        replaced = _SIMULATED
    return {name: said for name, said in weaker.items() if name not in replaced} | stronger


class File:
    """A settings file; *ignored* names keys that a project's file must not have.

    *trusted*: it is the user's own, DVTCLI_CONFIG names it, or the user trusts its present contents; otherwise only
    plain options count, and *withheld* names all other keys. *digest* is the hash for the trust, *keys* all keys of the
    file.
    """

    def __init__(self, found: SettingsFile, *, users_own: bool, believed: bool = False) -> None:
        """Read it, as trusted if *believed*; raises SafetyRefusal if others can write it, InputFileError if invalid."""
        from dvtcli.files.settings_file import MOST_BYTES, aliases, parsed, tables, transmit_lists
        from dvtcli.operations.user.trusted_settings import digest, is_trusted

        self.path, self.named = found.path, found.named
        data = content(found, MOST_BYTES)
        keys = parsed(data, self.path)
        self.keys = tuple(name.replace("_", "-") for name in keys)
        self.digest = digest(self.path, data)
        self.trusted = users_own or believed or found.named or is_trusted(self.digest)
        self.ignored = () if users_own else tuple(name for name in USERS_OWN if name in keys)
        passcode = keys.pop(PASSCODE, None)
        self.passcode = None if passcode is None or not users_own else str(passcode)
        self.aliases = aliases(keys.pop(ALIASES, {}), self.path)
        lists = keys.pop(TRANSMIT, {})
        #: the transmit list of each bus, in the user's own file only
        self.transmit_rows = transmit_lists(lists, self.path) if users_own else {}
        described = tables(keys.pop("bus", {}), self.path)
        self.layer = self._layer(keys, self.path)
        for name in self.ignored:
            self.layer.pop(name, None)
        self.buses = {name: self._bus(name, table) for name, table in described.items()}
        self.withheld = () if self.trusted else tuple(self._withhold())

    def chose(self, where: str) -> bool:
        """Tell whether *where*, in a layer, is this file or a table of it."""
        return where == self.path or (where.startswith("[bus.") and where.endswith(f"] of {self.path}"))

    def _withhold(self) -> Iterator[str]:
        """Remove folders of journals, URLs, and choices of libraries; yields their keys."""
        tables = {"": self.layer} | {f"bus.{name}.": layer for name, layer in self.buses.items()}
        for table, layer in tables.items():
            if "journal" in layer:
                del layer["journal"]
                yield f"{table}journal"
            if "interface" in layer and layer["interface"][0] in _LIBRARY_HERE:
                del layer["interface"]
                yield f"{table}interface"
            if "channel" in layer and _URL in layer["channel"][0]:
                del layer["channel"]
                yield f"{table}channel"
            if "bus_kwargs" in layer:
                pairs, where = layer["bus_kwargs"]
                harmless = tuple(pair for pair in pairs if not _reaches_further(pair))
                del layer["bus_kwargs"]
                if harmless:
                    layer["bus_kwargs"] = harmless, where
                yield from (f"{table}bus_kwargs.{pair.partition('=')[0]}" for pair in pairs if pair not in harmless)

    def _bus(self, name: str, table: Mapping[str, Any]) -> Layer:
        wrong = sorted(table.keys() & {*USERS_OWN, "bus"})
        if wrong:
            raise InputFileError(f"{self.path}: [bus.{name}]: {wrong[0]} is not a key of a bus", place=self.path)
        return self._layer(table, f"[bus.{name}] of {self.path}")

    def _layer(self, keys: Mapping[str, Any], where: str) -> Layer:
        table = "" if where == self.path else f"{where.partition(' of ')[0]}: "
        return {name: (self._value(name, value, table), where) for name, value in keys.items()}

    def _value(self, name: str, value: Any, table: str) -> Any:
        """Return the checked *value* of key *name*; *table* is the beginning of errors about a key in a table."""
        from dvtcli.files.settings_file import value_of

        known = sorted(Options._fields)
        if name not in known:
            raise InputFileError(
                f"{self.path}: {table}unknown key {name!r}",
                place=self.path,
                hint=f"keys are the options: {', '.join(known)}; and {PASSCODE}, [{ALIASES}], [{TRANSMIT}], [bus.NAME]",
            )
        default = getattr(Options(), name)
        try:
            value = value_of(name, value, default, self.path, repeated=is_repeated(name))
            if name == "journal" and value:
                value = os.path.join(os.path.dirname(os.path.abspath(self.path)), str(value))  # noqa: PTH100, PTH118, PTH120
            return checked(name, value)
        except UsageError as wrong:
            said = "".join(f"{value}: " for value in wrong.given.values() if value is not None)
            raise InputFileError(f"{self.path}: {table}{name}: {said}{wrong.text}", place=self.path) from wrong


class Settings:
    """All settings at the start of a program.

    *unusable* is the error for commands that need a bus: an untrusted or invalid file.
    """

    def __init__(self) -> None:
        self.unusable: DvtcliError | None = None
        self.project: File | None = None
        self.user: File | None = None
        self.variables: Layer = {}
        self.typed: Layer = {}
        #: source of each option in force: typed, its variable or the settings file
        self.sources: dict[str, str] = {}
        self._wrong: DvtcliError | None = None
        self._warned = False

    def start(self, given: Layer) -> dict[str, Any]:
        """Take the options at the start with their sources; returns the options in force."""
        self.typed |= given
        found, self._wrong = self.resolved()
        self.sources = {name: said for name, (_, said) in found.items()}
        return {name: value for name, (value, _) in found.items()}

    def required(self) -> list[Hint | str]:
        """Raise the error of the settings; once, return messages about ignored keys and an untrusted file."""
        if self._wrong is not None:
            raise self._wrong
        if self._warned:
            return []
        self._warned = True
        said = [self.never_taken(), self.withheld(), self._first_use()]
        return [line for line in said if line is not None]

    def withheld(self) -> Hint | None:
        """Report keys without effect until the project's file is trusted; None if there are none."""
        if self.project is None or not self.project.withheld:
            return None
        names = ", ".join(self.project.withheld)
        verb = "does" if len(self.project.withheld) == 1 else "do"
        why = "a folder of journals, an address with :// and a driver's library need a trusted file"
        return self.untrusted(f"{names} {verb} not count: {why}")

    def untrusted(self, what: str) -> Hint:
        """Add to *what*, about the project's file, how to trust it."""
        from dvtcli.domain.hint import Action, Hint, verbatim

        assert self.project is not None  # noqa: S101 - who asks has looked at it
        return Hint(
            Action.TRUST, why=f"{verbatim(self.project.path)}: {verbatim(what)}; {{}}, once you have looked at it"
        )

    def _first_use(self) -> Hint | None:
        """Report the first use of an untrusted project file, with all its settings."""
        file = self.project
        if file is None or file.trusted or not file.keys:
            return None
        from dvtcli.operations.user.trusted_settings import is_used, note_use

        if is_used(file.digest):
            return None
        note_use(file.digest, file.path)
        return self.untrusted(f"first used now, and not trusted; it sets {', '.join(file.keys)}")

    def project_bus(self) -> File | None:
        """Return the project's file if it chooses the bus; None if the user does."""
        if self.project is None or self.project.named or "sim" in self.sources:
            return None
        chosen = (self.sources.get(name, "") for name in _CHOOSES_BUS)
        return self.project if any(map(self.project.chose, chosen)) else None

    def is_typed(self, name: str) -> bool:
        """Tell whether the option *name* was typed, not set by variable or file."""
        return name in self.typed and self.sources.get(name) == self.typed[name][1]

    def place_of(self, name: str) -> str:
        """Describe the source of the option *name*."""
        return "option" if self.is_typed(name) else self.sources.get(name, "this line")

    def chosen_by(self) -> str:
        """Describe what chose the bus: option, variable or file; `nobody` if nothing did."""
        found = chooser(self.sources)
        if found is not None:
            return found
        from dvtcli.bus.python_can_settings import library_settings

        return library_settings().get("interface", ("", NOBODY))[1]

    def read_files(self) -> None:
        """Read the settings files in force."""
        for take in (self._take_user, self._take_project):
            try:
                take()
            except DvtcliError as wrong:
                self.unusable = wrong

    def _take_user(self) -> None:
        found = user_file()
        self.user = None if found is None else File(found, users_own=True)

    def _take_project(self) -> None:
        found = project_file()
        self.project = None if found is None else File(found, users_own=False)

    @property
    def files(self) -> list[File]:
        """Return the files in force, weaker first."""
        return [file for file in (self.user, self.project) if file is not None]

    @property
    def passcode(self) -> str | None:
        """Return the passcode for `login` in the user's own file; project files have none."""
        return None if self.user is None else self.user.passcode

    def never_taken(self) -> str | None:
        """Report ignored keys of a project's file; None if there are none."""
        if self.project is None or not self.project.ignored:
            return None
        names = ", ".join(name.replace("_", "-") for name in self.project.ignored)
        own = user_folder("config") / "config.toml"
        return f"{self.project.path}: {names}: never taken from a project's file; it may stand in {own}"

    def described_buses(self) -> Hint | None:
        """Explain how to choose a bus described in the files, None if there is none."""
        from dataclasses import replace

        from dvtcli.domain.hint import Action, Hint

        names = sorted({name for file in self.files for name in file.buses})
        if not names:
            return None
        first, *others = (Hint(Action.GIVE_BUS, {"bus": name}) for name in names)
        for other in others:
            first += replace(other, why=" or {}")
        return first + " chooses what a settings file describes"

    def resolved(self) -> tuple[Layer, DvtcliError | None]:
        """Return the settings in force, and the error that forbids their use, if any.

        An unknown bus name is returned as UsageError, not raised.
        """
        files: Layer = {}
        for file in self.files:
            files = laid_over(files, file.layer)
        try:
            chosen = self._named_bus()
        except UsageError as unknown:
            return laid_over(laid_over(files, self.variables), self.typed), self.unusable or unknown
        bus = {name: said for name, said in chosen.items() if name in _BUS}
        found = files | {name: said for name, said in chosen.items() if name not in _BUS}
        for layer in (self.variables, self.typed):
            if "bus" in layer:
                found = laid_over(found, {"bus": layer["bus"]}) | bus
                layer = {name: said for name, said in layer.items() if name != "bus"}  # noqa: PLW2901 - it is laid on that
            found = laid_over(found, layer)
        return found, self.unusable

    def _named_bus(self) -> Layer:
        """Return a file's settings of the bus chosen by name, empty if none is chosen."""
        for layer, weaker in ((self.typed, self.variables), (self.variables, {})):
            beside = sorted(layer.keys() & {"interface", "sim"})
            if "bus" in layer:
                if beside:
                    both = f"{layer['bus'][1]} and {layer[beside[0]][1]}"
                    raise UsageError(f"{both} exclude each other: each sets a bus; give only one of them")
                return self._described(*layer["bus"])
            if beside or "bus" not in weaker:
                return {}
        return {}

    def _described(self, name: str, where: str) -> Layer:
        described = {known: layer for file in self.files for known, layer in file.buses.items()}
        if name in described:
            return described[name]
        known = f"described are: {', '.join(sorted(described))}" if described else "no settings file describes any"
        raise UsageError(
            f"{where} {name}: no such bus", hint=f'{known}; [bus.{name}]  then  interface = "socketcan"  and so on'
        )


def chooser(sources: Mapping[str, str]) -> str | None:
    """Describe what chose the bus, by the sources of options; None for python-can's settings."""
    for name in ("sim", "interface", "channel"):
        if name in sources:
            by = sources.get("bus")
            return sources[name] if by is None else f"{sources[name]} ({by})"
    return None


#: The variable that names a project's file, then trusted wherever it is.
VARIABLE = "DVTCLI_CONFIG"
NAME = "dvtcli.toml"
#: Marks of a repository's root.
_ROOTS = (".git", ".hg")


class SettingsFile(NamedTuple):
    """A settings file at *path*; *named* by the environment: its owner is not checked."""

    path: str
    named: bool = False


def project_file() -> SettingsFile | None:
    """Find the file of DVTCLI_CONFIG, else the nearest `dvtcli.toml` here or above.

    Searches up to the root of the repository or the user's home, never above a home. Returns None if there is none.
    Raises UsageError if DVTCLI_CONFIG names no file, SafetyRefusal if a folder cannot be read.
    """
    if named := os.environ.get(VARIABLE):
        if not os.path.exists(named):  # noqa: PTH110 - pathlib costs 7 ms of a --help
            raise UsageError(f"{VARIABLE}={named}: no such file", hint=f"unset {VARIABLE}, or name a file")
        return SettingsFile(os.path.abspath(named), named=True)  # noqa: PTH100
    for folder in _folders():
        path = os.path.join(folder, NAME)  # noqa: PTH118
        try:
            os.lstat(path)
        except (FileNotFoundError, NotADirectoryError):
            continue
        except OSError as failed:
            raise SafetyRefusal(
                f"{folder} cannot be searched for {NAME}: {failed.strerror}",
                place=folder,
                hint=f"{VARIABLE}=FILE names one; {VARIABLE}={os.devnull} is none",
            ) from failed
        return SettingsFile(path)
    return None


def _folders() -> list[str]:
    """Return folders for a project's file, nearest first."""
    try:
        folder = os.path.realpath(os.getcwd())  # noqa: PTH109
    except FileNotFoundError:
        raise SafetyRefusal("this folder was removed: it is unknown which settings apply here", hint="cd") from None
    homes = _homes()
    above = {parent for home in homes for parent in _parents(home)}
    folders: list[str] = []
    for searched_folder in (folder, *_parents(folder)):
        if searched_folder in above and searched_folder != folder:
            break
        folders.append(searched_folder)
        if searched_folder in homes or any(os.path.lexists(os.path.join(searched_folder, root)) for root in _ROOTS):  # noqa: PTH118
            break
    return folders


def _parents(folder: str) -> list[str]:
    found = []
    while (above := os.path.dirname(folder)) != folder:  # noqa: PTH120
        folder = above
        found.append(folder)
    return found


def _homes() -> set[str]:
    """Return the user's home, and that of sudo's caller."""
    homes = {os.path.realpath(os.path.expanduser("~"))}  # noqa: PTH111
    caller = sudo_user()
    if caller is not None and sys.platform != "win32":
        import pwd

        try:
            homes.add(os.path.realpath(pwd.getpwuid(caller).pw_dir))
        except KeyError:
            return homes  # a number without a name has no home either
    return homes


def user_file() -> SettingsFile | None:
    """Return the user's own `config.toml`, None if there is none."""
    path = str(user_folder("config") / "config.toml")
    return SettingsFile(path) if os.path.lexists(path) else None


def content(found: SettingsFile, most_bytes: int) -> bytes:
    """Read the file, up to *most_bytes* plus a byte.

    Raises SafetyRefusal with a remedy if another user may have written it, InputFileError if it cannot be read.
    """
    path = found.path
    try:
        if not found.named:
            _refuse_strangers(path, os.lstat(path), os.path.dirname(path))  # noqa: PTH120
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0))
        with os.fdopen(descriptor, "rb") as file:
            status = os.fstat(file.fileno())
            if not found.named:
                _refuse_strangers(path, status, os.path.dirname(os.path.realpath(path)))  # noqa: PTH120
            if not stat.S_ISREG(status.st_mode) and not os.path.samefile(path, os.devnull):  # noqa: PTH121
                raise InputFileError(f"{path}: not a file", place=path, hint="remove it, or give it another name")
            return file.read(most_bytes + 1)
    except OSError as failed:
        hint = None if isinstance(failed, PermissionError) else "remove it, or mend it"
        raise InputFileError(f"{path}: cannot be read: {failed.strerror}", place=path, hint=hint) from failed


def _refuse_strangers(path: str, status: os.stat_result, folder: str) -> None:
    """Raises SafetyRefusal if, by *status* or *folder*, another user controls *path*."""
    is_link = stat.S_ISLNK(status.st_mode)
    found = stranger(path, status) if not is_link else _link_of_stranger(path, status)
    found = found or replaceable(folder)
    if found is not None:
        why, cure = found
        trusting = f"; or {VARIABLE}={path} in the environment trusts it as it is" if _is_project(path) else ""
        raise SafetyRefusal(f"{path} is not trusted: {why}", place=path, hint=f"{cure}{trusting}")


def _link_of_stranger(path: str, status: os.stat_result) -> tuple[str, str] | None:
    """Report a link of another user: its owner decides, as a link's mode says nothing."""
    found = stranger(path, os.stat_result((status.st_mode & ~0o022, *status[1:])))
    return found and (found[0].replace("it belongs", "the link belongs"), f"rm {path}")


def _is_project(path: str) -> bool:
    return os.path.basename(path) == NAME  # noqa: PTH119


def why_unusable(path: str) -> DvtcliError | None:
    """Return the error of the settings file *path* at the next start, None if it is usable."""
    try:
        content(SettingsFile(os.path.abspath(path)), 0)  # noqa: PTH100
    except DvtcliError as refused:
        return refused
    return None
