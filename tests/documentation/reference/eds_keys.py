"""The keys of EDS and DCF files, from the tables of `eds check`, with their meanings from `eds_keys.toml`."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from dvtcli.files.eds.keys import KEYS, OBJECT
from dvtcli.files.eds.lint_keys import SECTIONS
from tests.documentation.reference.markdown import cell, code, table

MEANINGS: Mapping[str, Mapping[str, str]] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))
#: bit rates share a line
_RATE = re.compile(r"(?<=^BaudRate_)\d+$")


def keys() -> Iterator[str]:
    """A table of keys for each section, then the sections."""
    for name, found in KEYS.items():
        title = "An object: [1234], [1234sub5]" if name == OBJECT else f"[{SECTIONS[name]}]"
        yield from _keys(title, name, found)
    yield from ("", "## Sections", "")
    sections = [(f"[{name}]", _meaning("sections", name)) for name in SECTIONS.values()]
    tables = [(f"[1234{name}]", _meaning("tables", name)) for name in MEANINGS["tables"]]
    yield from table(("section", "means"), ((code(name), means) for name, means in (*sections, *tables)))


def _keys(title: str, name: str, found: Iterable[str]) -> Iterator[str]:
    yield from ("", f"## {title}", "")
    lines = dict.fromkeys(_RATE.sub("N", key) for key in found)
    yield from table(("key", "means"), ((code(key), _meaning(name, key)) for key in lines))


def _meaning(section: str, key: str) -> str:
    """The meaning of *key*; an AssertionError names what `eds_keys.toml` lacks."""
    assert key in MEANINGS[section], f"eds_keys.toml does not say what {key} of {section} means"
    return cell(MEANINGS[section][key])
