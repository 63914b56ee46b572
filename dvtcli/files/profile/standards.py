"""What the standards of CiA say their objects mean: one TOML file each, beside the families. Does not know a device."""

from __future__ import annotations

from functools import cache

from dvtcli.domain.meanings import Standard
from dvtcli.domain.object_dictionary import normalised
from dvtcli.files.family_folder import family_path
from dvtcli.files.profile.physical_toml import physical_rules
from dvtcli.files.toml_item import Item, Schema, integer, read_toml, string

_FOLDER, _FILES = "standard", ("cia301.toml", "cia401.toml", "cia402.toml")


@cache
def standards() -> tuple[Standard, ...]:
    """All of them, read once."""
    return tuple(_read(name) for name in _FILES)


def _read(name: str) -> Standard:
    text = family_path(_FOLDER, name).read_text(encoding="utf-8")
    said = read_toml(text, f"{_FOLDER}/{name}").table(_KEYS, required=_KEYS)
    return Standard(said["number"], said["physical"], said["names"])


def _names(item: Item) -> dict[int, str]:
    return {int(member.key, 16): normalised(string(member)) for member in item.items()}


_KEYS: Schema = {"number": integer(301, 999), "physical": physical_rules, "names": _names}
