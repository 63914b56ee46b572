"""What options, variables and settings files say, laid over one another: the stronger one wins, a whole bus at a time.

The order: option, DVTCLI_…, the project's dvtcli.toml, the user's config.toml. What none of them says is left to
python-can. Does not know how options are parsed, nor what they do.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from dvtcli.errors import DvtcliError, InputFileError, UsageError
from dvtcli.files.user_folders import user_folder
from dvtcli.operations.user.options import Options, checked, is_repeated
from dvtcli.operations.user.settings_search import SettingsFile, content, project_file, user_file

if TYPE_CHECKING:
    from dvtcli.domain.hint import Hint

#: Who chose the bus where no option, variable or file did.
NOBODY = "nobody"

#: Values by the option's name, each with where it was said.
Layer = dict[str, tuple[Any, str]]

#: What together chooses a bus.
_SIMULATED = frozenset({"sim", "fault", "signal"})
_BUS = frozenset({"bus", "interface", "channel", "bitrate", "bus_kwargs"}) | _SIMULATED
#: The key that is no option: what `login` would ask for.
PASSCODE = "passcode"
#: The table of the prompt's words.
ALIASES = "aliases"
#: What somebody else's project must not decide.
USERS_OWN = ("yes", "force", PASSCODE, "no_shell")
#: What makes a channel a URL: pyserial has some that write any file.
_URL = "://"
#: Keys of drivers that name a library to load, and how such a file is called.
_LIBRARY_KEY, _LIBRARY_FILE = re.compile(r"(?i)dll|lib"), re.compile(r"(?i)\.(dll|so|dylib|pyd|ocx)\b")
#: Interfaces whose driver takes its library from the folder that it is started in, by python-can 4: on Windows
#: `./WDT_DIO.dll`.
_LIBRARY_HERE = frozenset({"neousys"})
#: What says where the frames of a bus go.
_CHOOSES_BUS = ("interface", "channel", "bus_kwargs", "bus")


def _reaches_further(pair: str) -> bool:
    """Whether the KEY=VALUE of a bus can make a driver open a URL or load a library."""
    key, _, value = pair.partition("=")
    return _URL in value or _LIBRARY_KEY.search(key) is not None or _LIBRARY_FILE.search(value) is not None


def laid_over(weaker: Layer, stronger: Layer) -> Layer:
    """Both, *stronger* winning: where it chooses a bus, nothing of the bus that *weaker* chooses is left.

    A stronger channel, bit rate or further key alone changes the weaker bus, but no simulated node has a channel.
    """
    replaced: frozenset[str] = frozenset()
    if stronger.keys() & {"bus", "sim", "interface"}:
        replaced = _BUS
    elif "channel" in stronger:
        replaced = _SIMULATED
    return {name: said for name, said in weaker.items() if name not in replaced} | stronger


class File:
    """What one settings file says; *ignored* names the keys that a project's file may not have.

    *trusted*: it is the user's own, DVTCLI_CONFIG names it, or the user trusts it as it is now; else what it could do
    beyond choosing plain options does not count, and *withheld* names such keys. *digest* is the hash that trust
    belongs to, *keys* all that the file sets.
    """

    def __init__(self, found: SettingsFile, *, users_own: bool, believed: bool = False) -> None:
        """Read it, as a trusted file if *believed*; SafetyRefusal if others can write it, InputFileError if wrong."""
        from dvtcli.files.settings_file import MOST_BYTES, aliases, parsed, tables
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
        described = tables(keys.pop("bus", {}), self.path)
        self.layer = self._layer(keys, self.path)
        for name in self.ignored:
            self.layer.pop(name, None)
        self.buses = {name: self._bus(name, table) for name, table in described.items()}
        self.withheld = () if self.trusted else tuple(self._withhold())

    def chose(self, where: str) -> bool:
        """Whether *where*, as a layer says it, is this file or one of its tables."""
        return where == self.path or (where.startswith("[bus.") and where.endswith(f"] of {self.path}"))

    def _withhold(self) -> Iterator[str]:
        """Take away folders of journals, URLs, and what chooses a library to load; the keys of what is gone."""
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
            raise InputFileError(f"{self.path}: [bus.{name}]: {wrong[0]} is no part of a bus", place=self.path)
        return self._layer(table, f"[bus.{name}] of {self.path}")

    def _layer(self, keys: Mapping[str, Any], where: str) -> Layer:
        return {name: (self._value(name, value), where) for name, value in keys.items()}

    def _value(self, name: str, value: Any) -> Any:
        from dvtcli.files.settings_file import value_of

        known = sorted(Options._fields)
        if name not in known:
            raise InputFileError(
                f"{self.path}: unknown key {name!r}",
                place=self.path,
                hint=f"keys are the options: {', '.join(known)}; and {PASSCODE}, [{ALIASES}], [bus.NAME]",
            )
        default = getattr(Options(), name)
        try:
            value = value_of(name, value, default, self.path, repeated=is_repeated(name))
            if name == "journal" and value:
                value = os.path.join(os.path.dirname(os.path.abspath(self.path)), str(value))  # noqa: PTH100, PTH118, PTH120
            return checked(name, value)
        except UsageError as wrong:
            said = "".join(f"{value}: " for value in wrong.given.values() if value is not None)
            raise InputFileError(f"{self.path}: {name}: {said}{wrong.text}", place=self.path) from wrong


class Settings:
    """Everything that was said at the start of a program.

    *unusable* is the error that commands which need a bus end with: a file that is not trusted, or wrong.
    """

    def __init__(self) -> None:
        self.unusable: DvtcliError | None = None
        self.project: File | None = None
        self.user: File | None = None
        self.variables: Layer = {}
        self.typed: Layer = {}
        #: where each option that counts was said: typed, in its variable or in the settings file
        self.sources: dict[str, str] = {}
        self._wrong: DvtcliError | None = None
        self._warned = False

    def start(self, given: Layer) -> dict[str, Any]:
        """Take the options of the program's start, each with where it was said; what counts now, by option."""
        self.typed |= given
        found, self._wrong = self.resolved()
        self.sources = {name: said for name, (_, said) in found.items()}
        return {name: value for name, (value, _) in found.items()}

    def required(self) -> list[Hint | str]:
        """Raise what is wrong where something is; once, what to say of keys in vain, and of an untrusted file."""
        if self._wrong is not None:
            raise self._wrong
        if self._warned:
            return []
        self._warned = True
        said = [self.never_taken(), self.withheld(), self._first_use()]
        return [line for line in said if line is not None]

    def withheld(self) -> Hint | None:
        """What to say of keys that do not count until the project's file is trusted; None where it has none."""
        if self.project is None or not self.project.withheld:
            return None
        names = ", ".join(self.project.withheld)
        verb = "does" if len(self.project.withheld) == 1 else "do"
        why = "a folder of journals, an address with :// and a driver's library need a trusted file"
        return self.untrusted(f"{names} {verb} not count: {why}")

    def untrusted(self, what: str) -> Hint:
        """*what* is to be said of the project's file, and how it is trusted."""
        from dvtcli.domain.hint import Action, Hint, verbatim

        assert self.project is not None  # noqa: S101 - who asks has looked at it
        return Hint(
            Action.TRUST, why=f"{verbatim(self.project.path)}: {verbatim(what)}; {{}}, once you have looked at it"
        )

    def _first_use(self) -> Hint | None:
        """What to say when an untrusted file of a project is used for the first time, with all that it sets."""
        file = self.project
        if file is None or file.trusted or not file.keys:
            return None
        from dvtcli.operations.user.trusted_settings import is_used, note_use

        if is_used(file.digest):
            return None
        note_use(file.digest, file.path)
        return self.untrusted(f"first used now, and not trusted; it sets {', '.join(file.keys)}")

    def project_bus(self) -> File | None:
        """The project's file where it says where the frames of the bus go; None where the user's own words do."""
        if self.project is None or self.project.named or "sim" in self.sources:
            return None
        chosen = (self.sources.get(name, "") for name in _CHOOSES_BUS)
        return self.project if any(map(self.project.chose, chosen)) else None

    def is_typed(self, name: str) -> bool:
        """Whether the option *name* counts as it was typed, and no variable or file says it."""
        return name in self.typed and self.sources.get(name) == self.typed[name][1]

    def place_of(self, name: str) -> str:
        """Where the option *name* that counts now was said, for people."""
        return "option" if self.is_typed(name) else self.sources.get(name, "this line")

    def chosen_by(self) -> str:
        """Who chose the bus: an option, a variable or a file, for people; `nobody` where none did."""
        found = chooser(self.sources)
        if found is not None:
            return found
        from dvtcli.bus.python_can_settings import library_settings

        return library_settings().get("interface", ("", NOBODY))[1]

    def read_files(self) -> None:
        """Take the settings files that count here."""
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
        """The files that count, the weaker first."""
        return [file for file in (self.user, self.project) if file is not None]

    @property
    def passcode(self) -> str | None:
        """What the user's own file has for `login`; no project's file can."""
        return None if self.user is None else self.user.passcode

    def never_taken(self) -> str | None:
        """What to say of keys that a project's file has in vain; None where it has none."""
        if self.project is None or not self.project.ignored:
            return None
        names = ", ".join(name.replace("_", "-") for name in self.project.ignored)
        own = user_folder("config") / "config.toml"
        return f"{self.project.path}: {names}: never taken from a project's file; it may stand in {own}"

    def described_buses(self) -> Hint | None:
        """How to choose one of the buses that the files describe, None if they describe none."""
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
        """What counts in the end, and why it must not be used where it must not.

        UsageError, given back and not raised, where a bus is chosen that no file describes.
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
        """What a file says of the bus that is chosen by its name, nothing where none is chosen in the end."""
        for layer, weaker in ((self.typed, self.variables), (self.variables, {})):
            beside = sorted(layer.keys() & {"interface", "sim"})
            if "bus" in layer:
                if beside:
                    both = f"{layer['bus'][1]} and {layer[beside[0]][1]}"
                    raise UsageError(f"{both} exclude each other: each chooses a bus, leave one out")
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
    """Who chose the bus, for people, by where each option was said; None where python-can's own settings do."""
    for name in ("sim", "interface", "channel"):
        if name in sources:
            by = sources.get("bus")
            return sources[name] if by is None else f"{sources[name]} ({by})"
    return None
