"""What options, variables and settings files say, laid over one another: the stronger one wins, a whole bus at a time.

The order: option, DVTCLI_…, the project's dvtcli.toml, the user's config.toml. What none of them says is left to
python-can. Does not know how options are parsed, nor what they do.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dvtcli.errors import DvtcliError, InputFileError, UsageError
from dvtcli.files.user_folders import user_folder
from dvtcli.operations.user.options import Options, checked, is_repeated
from dvtcli.operations.user.settings_search import Found, content, project_file, user_file

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
    """What one settings file says; *ignored* names the keys that a project's file may not have."""

    def __init__(self, found: Found, *, users_own: bool) -> None:
        """Read it; SafetyRefusal where it is not trusted, InputFileError where it is wrong."""
        from dvtcli.files.settings_file import MOST_BYTES, aliases, parsed, tables

        self.path = found.path
        keys = parsed(content(found, MOST_BYTES), self.path)
        self.ignored = () if users_own else tuple(name for name in USERS_OWN if name in keys)
        passcode = keys.pop(PASSCODE, None)
        self.passcode = None if passcode is None or not users_own else str(passcode)
        self.aliases = aliases(keys.pop(ALIASES, {}), self.path)
        described = tables(keys.pop("bus", {}), self.path)
        self.layer = self._layer(keys, self.path)
        for name in self.ignored:
            self.layer.pop(name, None)
        self.buses = {name: self._bus(name, table) for name, table in described.items()}

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
            return checked(name, value_of(name, value, default, self.path, repeated=is_repeated(name)))
        except UsageError as wrong:
            raise InputFileError(f"{self.path}: {name}: {wrong.text}", place=self.path) from wrong


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
        #: where each option that counts was said: `option`, its variable or the settings file
        self.sources: dict[str, str] = {}
        self._wrong: DvtcliError | None = None
        self._warned = False

    def start(self, given: Mapping[str, Any], where: str) -> dict[str, Any]:
        """Take the options of the program's start, which were said in *where*; what counts now, by option."""
        self.typed |= {name: (value, where) for name, value in given.items()}
        found, self._wrong = self.resolved()
        self.sources = {name: said for name, (_, said) in found.items()}
        return {name: value for name, (value, _) in found.items()}

    def required(self) -> str | None:
        """Raise what is wrong where something is; once, what to say of keys that stand in a file in vain."""
        if self._wrong is not None:
            raise self._wrong
        said = None if self._warned else self.never_taken()
        self._warned = True
        return said

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

    @property
    def aliases(self) -> dict[str, str]:
        """The words of the prompt's user."""
        return {word: text for file in self.files for word, text in file.aliases.items()}

    def never_taken(self) -> str | None:
        """What to say of keys that a project's file has in vain; None where it has none."""
        if self.project is None or not self.project.ignored:
            return None
        names = ", ".join(name.replace("_", "-") for name in self.project.ignored)
        own = user_folder("config") / "config.toml"
        return f"{self.project.path}: {names}: never taken from a project's file; it may stand in {own}"

    def described_buses(self) -> str:
        """How to choose one of the buses that the files describe, empty where they describe none."""
        names = sorted({name for file in self.files for name in file.buses})
        return (
            f"{' or '.join(f'--bus {name}' for name in names)} chooses what a settings file describes" if names else ""
        )

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
        """What a file says of the bus that --bus or its variable chooses, nothing where none is chosen in the end."""
        for layer, weaker in ((self.typed, self.variables), (self.variables, {})):
            beside = sorted(layer.keys() & {"interface", "sim"})
            if "bus" in layer:
                if beside:
                    raise UsageError(f"--bus and --{beside[0]} exclude each other: each chooses a bus, leave one out")
                return self._described(*layer["bus"])
            if beside or "bus" not in weaker:
                return {}
        return {}

    def _described(self, name: str, where: str) -> Layer:
        described = {known: layer for file in self.files for known, layer in file.buses.items()}
        if name in described:
            return described[name]
        said = "--bus" if where == "option" else where
        known = f"described are: {', '.join(sorted(described))}" if described else "no settings file describes any"
        raise UsageError(
            f"{said} {name}: no such bus", hint=f'{known}; [bus.{name}]  then  interface = "socketcan"  and so on'
        )


def chooser(sources: Mapping[str, str]) -> str | None:
    """Who chose the bus, for people, by where each option was said; None where python-can's own settings do."""
    for name in ("sim", "interface", "channel"):
        if name in sources:
            where = sources[name]
            by = sources.get("bus")
            option = f"--{name}" if where == "option" else where
            return option if by is None else f"{option} (--bus)" if by == "option" else f"{option} ({by})"
    return None
