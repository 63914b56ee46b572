"""A PDO as YAML for `pdo edit`: written with comments, read back with the line of every error.

Values keep their text instead of YAML types: `6041` is an index, not a number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from dvtcli.domain.datatypes import parse_number
from dvtcli.domain.object_syntax import parse_cob_id
from dvtcli.domain.pdo import Pdo, PdoConfig, transmission_type_text
from dvtcli.errors import InputFileError

if TYPE_CHECKING:
    from ruamel.yaml.nodes import MappingNode, Node, ScalarNode

#: Maximum length; a longer text is not a PDO.
MOST_CHARACTERS = 100_000
_KEYS = (
    "pdo", "cob_id", "enabled", "rtr_allowed", "extended", "type", "inhibit_ms", "event_timer_ms", "sync_start",
    "mapping",
)  # fmt: skip
_TRUTH = {"true": True, "yes": True, "on": True, "false": False, "no": False, "off": False}


@dataclass(frozen=True, slots=True)
class MappingWord:
    """A mapping entry as written, and its line (from 1)."""

    text: str
    line: int


@dataclass(frozen=True, slots=True)
class PdoText:
    """The settings in a text; None for absent settings. *inhibit_time* counts 100 µs, *event_timer* 1 ms."""

    cob_id: int | Literal["auto", "keep"] | None = None
    enabled: bool | None = None
    rtr_allowed: bool | None = None
    extended: bool = False
    transmission_type: int | None = None
    inhibit_time: int | None = None
    event_timer: int | None = None
    sync_start_value: int | None = None
    mapping: tuple[MappingWord, ...] | None = None


def write_pdo_yaml(pdo: Pdo, config: PdoConfig, names: Sequence[str], title: str) -> str:
    """Return the text of *pdo* as configured; *names* are its mapped objects' names, *title* names the node."""
    held = config.communication
    kind = held.transmission_type
    rows: list[tuple[str, object, str]] = [
        ("pdo", pdo, ""),
        ("cob_id", str(held.cob_id), "or auto"),
        ("enabled", str(config.enabled).lower(), "bit 31 of the COB-ID"),
        ("rtr_allowed", str(held.cob_id.rtr_allowed).lower(), "bit 30"),
        ("extended", str(held.cob_id.extended).lower(), "a 29-bit CAN-ID"),
    ]
    if kind is not None:
        rows.append(("type", kind, transmission_type_text(kind, pdo.direction)))
    if held.inhibit_time is not None:
        rows.append(("inhibit_ms", held.inhibit_time / 10, "steps of 0.1"))
    if held.event_timer is not None:
        rows.append(("event_timer_ms", held.event_timer, "0 is off"))
    if held.sync_start_value is not None:
        rows.append(("sync_start", held.sync_start_value, ""))
    lines = [f"# {pdo.label} of {_one_line(title)}. Save and leave: what differs is checked, shown and written."]
    lines += [f"{f'{key}: {value}':<24}{f'# {remark}' if remark else ''}".rstrip() for key, value, remark in rows]
    lines.append("mapping:" if config.mapping else "mapping: []            # in frame order: - 6041:00/16")
    for entry, name in zip(config.mapping, names, strict=True):
        word = f"dummy/{entry.bits}" if entry.is_dummy else str(entry)
        lines.append(f"  - {word:<20}{f'# {_one_line(name)}' if name else ''}".rstrip())
    return "\n".join([*lines, ""])


def _one_line(text: str) -> str:
    return "".join(char if char.isprintable() else "?" for char in text)


def read_pdo_yaml(text: str, pdo: Pdo) -> PdoText:
    """Read the settings of *pdo* in *text*. Raises InputFileError with the line, also for a repeated key."""
    keys = {key.value: (key, value) for key, value in _root(text).value}
    if "pdo" in keys:
        _same_pdo(keys["pdo"][1], pdo)

    def number(name: str, low: int, high: int, unit_ms: float = 1) -> int | None:
        return _number(keys[name][1], low, high, unit_ms) if name in keys else None

    def truth(name: str) -> bool | None:
        return _truth(keys[name][1]) if name in keys else None

    return PdoText(
        cob_id=_cob_id(keys["cob_id"][1]) if "cob_id" in keys else None,
        enabled=truth("enabled"),
        rtr_allowed=truth("rtr_allowed"),
        extended=truth("extended") or False,
        transmission_type=number("type", 0, 255),
        inhibit_time=number("inhibit_ms", 0, 0xFFFF, 0.1),
        event_timer=number("event_timer_ms", 0, 0xFFFF),
        sync_start_value=number("sync_start", 0, 255),
        mapping=_mapping(keys["mapping"][1]) if "mapping" in keys else None,
    )


def wrong_at(line: int, text: str) -> InputFileError:
    """Return the error for *line* (from 1) of the text."""
    return InputFileError(f"line {line}: {text}", place=f"line {line}")


def _root(text: str) -> MappingNode:
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError, YAMLError
    from ruamel.yaml.nodes import MappingNode, ScalarNode

    from dvtcli.files.network.yaml_tree import yaml_problem

    if len(text) > MOST_CHARACTERS:
        raise InputFileError(f"{len(text)} characters are no PDO")
    try:
        yaml = YAML(typ="safe", pure=True)
        yaml.composer.warn_double_anchors = False  # YAML 1.2, 3.2.2.2: an anchor may be set again
        node = yaml.compose(text)
    except MarkedYAMLError as wrong:
        mark = wrong.problem_mark or wrong.context_mark
        raise wrong_at(mark.line + 1 if mark else 1, yaml_problem(wrong)) from wrong
    except (YAMLError, RecursionError, ValueError) as wrong:
        raise wrong_at(1, f"not YAML: {str(wrong).splitlines()[0] if str(wrong) else 'too deep'}") from wrong
    if not isinstance(node, MappingNode):
        raise wrong_at(1, "a PDO is written as `key: value` lines")
    seen: dict[str, int] = {}
    for key, _ in node.value:
        line = key.start_mark.line + 1
        if not isinstance(key, ScalarNode) or key.value not in _KEYS:
            raise _unknown(key, line)
        if key.value in seen:
            raise wrong_at(line, f"{key.value} is in line {seen[key.value]} already")
        seen[key.value] = line
    return node


def _unknown(key: Node, line: int) -> InputFileError:
    from difflib import get_close_matches

    name = str(key.value)
    close = get_close_matches(name, _KEYS, n=1)
    return wrong_at(
        line, f"unknown key {name[:40]!r}; " + (f"did you mean {close[0]!r}?" if close else " ".join(_KEYS))
    )


def _scalar(node: Node) -> ScalarNode:
    from ruamel.yaml.nodes import ScalarNode

    if not isinstance(node, ScalarNode):
        raise wrong_at(node.start_mark.line + 1, "one value belongs here")
    return node


def _text(node: Node) -> tuple[str, int]:
    return str(_scalar(node).value).strip(), node.start_mark.line + 1


def _same_pdo(node: Node, pdo: Pdo) -> None:
    text, line = _text(node)
    if text.lower() != str(pdo):
        raise wrong_at(line, f"this is about {pdo}, not {text[:40]!r}")


def _cob_id(node: Node) -> int | Literal["auto", "keep"]:
    text, line = _text(node)
    match text.lower():
        case "auto":
            return "auto"
        case "keep":
            return "keep"
    try:
        return parse_cob_id(text)
    except ValueError as wrong:
        raise wrong_at(line, str(wrong)) from wrong


def _truth(node: Node) -> bool:
    text, line = _text(node)
    if text.lower() not in _TRUTH:
        raise wrong_at(line, f"true or false is expected here, not {text[:40]!r}")
    return _TRUTH[text.lower()]


def _number(node: Node, low: int, high: int, unit_ms: float) -> int:
    """Read a time as counts of *unit_ms*, within *low*..*high* counts."""
    text, line = _text(node)
    try:
        value = float(text) / unit_ms if unit_ms != 1 else float(parse_number(text))
    except ValueError as wrong:
        raise wrong_at(line, f"{text[:40]!r} is not a number") from wrong
    if not low <= value <= high or abs(value - round(value)) > 1e-6:
        step = f" in steps of {unit_ms}" if unit_ms != 1 else ""
        raise wrong_at(line, f"{text} is not within {low}…{high * unit_ms:g}{step}")
    return round(value)


def _mapping(node: Node) -> tuple[MappingWord, ...]:
    from ruamel.yaml.nodes import ScalarNode, SequenceNode

    if isinstance(node, ScalarNode) and str(node.value) in ("", "~", "null"):
        return ()
    if not isinstance(node, SequenceNode):
        raise wrong_at(node.start_mark.line + 1, "the mapping is a list: one `- OBJECT/BITS` a line")
    return tuple(MappingWord(*_text(entry)) for entry in node.value)
