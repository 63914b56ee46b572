"""The keys of a network file as tables, and as a JSON schema for editors."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Any

from dvtcli.files.network.network_keys import KEYS, OF, STORE_WORDS, Kind, NetworkKey, Where
from tests.documentation.reference.markdown import cell, code, table
from tests.surroundings import ROOT

#: where the schema is published: in the package, and beside its page
SCHEMA_FILES = (ROOT / "dvtcli/files/network/network.schema.json", ROOT / "docs/reference/network.schema.json")
#: the mappings that keys stand in, in the order of the page
_PLACES = {
    Where.FILE: "The file",
    Where.NODE: "A node",
    Where.TPDO: "A TPDO",
    Where.RPDO: "An RPDO",
    Where.ENTRY: "An object of a mapping, in long form",
    Where.SDO: "An entry of `sdo`",
    Where.IDENTITY: "`identity`",
    Where.LINK: "A link",
    Where.MASTER: "`master`",
    Where.OPTIONS: "`options`",
}
#: a YAML mapping that is left empty is nothing at all
_TABLE = ["object", "null"]
_BITS_30_AND_31 = (0, 1 << 30, 1 << 31, 3 << 30)
Schema = dict[str, Any]


def keys() -> Iterator[str]:
    """A table for each place."""
    for where, title in _PLACES.items():
        yield from ("", f"### {title}", "")
        yield from table(("key", "takes", "means"), (_row(key) for key in OF[where].values() if not key.noted))
        noted = [key for key in OF[where].values() if key.noted]
        if noted:
            yield ""
            yield f"Ignored: {'; '.join(_noted(noted))}."


def _row(key: NetworkKey) -> tuple[str, str, str]:
    needed = "; required" if key.required else ""
    objects = f" (0x{key.object[0]:04X})" if key.object else ""
    return code(key.name), cell(_takes(key)), cell(f"{key.sense}{objects}{needed}")


def _takes(key: NetworkKey) -> str:
    if not key.high:
        return str(key.kind)
    high = f"0x{int(key.high):X}" if key.high >= 0xFFFF and not key.unit else f"{key.high:.12g}"
    span = f"{key.low:g}…{high}{f' × {key.unit}' if key.unit[:1].isdigit() else f' {key.unit}'}".rstrip()
    if key.kind in (Kind.INTEGER, Kind.NUMBER):
        return span
    return {
        Kind.COB_ID: f"{span}, or `auto`",
        Kind.STORE: f"true, false, {', '.join(f'`{word}`' for word in STORE_WORDS)}, {span}",
        Kind.WATCH: f"true, false, or producers, each with {span}",
        Kind.NUMBERS: f"sub-indices, each with {span}",
        Kind.HEARTBEAT: f"{span}, or false",
        Kind.MODULES: f"a list, each {span}",
    }[key.kind]


def _noted(noted: list[NetworkKey]) -> Iterator[str]:
    for sense in dict.fromkeys(key.sense for key in noted):
        yield f"{' '.join(code(key.name) for key in noted if key.sense == sense)} ({sense})"


def schema_text() -> str:
    """The schema as it is published."""
    return json.dumps(schema(), indent=1, ensure_ascii=False) + "\n"


def schema() -> Schema:
    """Draft 7, which editors know best."""
    places = (Where.NODE, Where.TPDO, Where.RPDO, Where.ENTRY, Where.SDO, Where.IDENTITY, Where.LINK)
    named = OF[Where.FILE]
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "dvtcli network file",
        "description": "The values of the nodes of a CANopen network. Files for dcfgen and ros2_canopen fit, too.",
        "type": "object",
        "properties": {name: _of(key) for name, key in named.items()},
        "patternProperties": {r"^\.": True},
        "additionalProperties": {
            "if": {"type": "object", "required": ["node_id"]},
            "then": {"$ref": "#/definitions/node"},
        },
        "if": {"not": {"required": ["nodes"]}},
        "then": {
            "properties": dict.fromkeys(named, True),
            "patternProperties": {r"^\.": True},
            "additionalProperties": {"if": {"type": "object"}, "then": {"$ref": "#/definitions/node"}},
        },
        "definitions": {
            "keys-of-a-node": _mapping(Where.NODE, required=False, kind=_TABLE),
            **{str(where): _mapping(where) for where in places},
        },
    }


def _mapping(where: Where, *, required: bool = True, kind: object = "object") -> Schema:
    made: Schema = {"type": kind, "properties": {name: _of(key) for name, key in OF[where].items()}}
    needed = [key.name for key in OF[where].values() if key.required]
    if needed and required:
        made["required"] = needed
    if where not in (Where.NODE, Where.MASTER, Where.OPTIONS):
        made["additionalProperties"] = False
    return made | _EXTRA.get(where, {})


_EXTRA: dict[Where, Schema] = {
    Where.TPDO: {"not": {"required": ["inhibit_time", "inhibit_ms"]}},
    Where.SDO: {
        "oneOf": [
            {"required": ["index"], "not": {"required": ["object"]}},
            {"required": ["object"], "not": {"anyOf": [{"required": ["index"]}, {"required": ["sub_index"]}]}},
        ]
    },
}


def _of(key: NetworkKey) -> Schema:
    unit = f" ({key.unit})" if key.unit else ""
    return {"description": f"{key.sense}{unit}".replace("`", ""), **_type(key)}


def _type(key: NetworkKey) -> Schema:
    return _TYPES[key.kind](key) if key.kind in _TYPES else _PLAIN[key.kind]


def _whole(key: NetworkKey) -> Schema:
    return {"type": "integer", "minimum": int(key.low), "maximum": int(key.high)}


def _cob_id(_key: NetworkKey) -> Schema:
    """auto, a CAN-ID of 11 bits, or one of 29 with bit 29; bits 30 and 31 as they like."""
    numbers = [
        {"type": "integer", "minimum": flags | low, "maximum": flags | high}
        for flags in _BITS_30_AND_31
        for low, high in ((0, 0x7FF), (1 << 29, 0x3FFF_FFFF))
    ]
    return {"anyOf": [{"const": "auto"}, *numbers]}


def _pdos(key: NetworkKey) -> Schema:
    pdo = {"anyOf": [{"$ref": f"#/definitions/{key.name}"}, {"type": "null"}]}
    return {"type": _TABLE, "patternProperties": {f"^{_PDO_NUMBER}$": pdo}, "additionalProperties": False}


def _list_of(name: str) -> Schema:
    return {"type": "array", "items": {"$ref": f"#/definitions/{name}"}}


def _endpoint(letters: str) -> Schema:
    return {"type": "string", "pattern": f"[^:]:[{letters}][xX]?[pP][dD][oO]{_PDO_NUMBER}$"}


def _table_of(key: NetworkKey) -> Schema:
    if key.name == "defaults":
        return {"allOf": [{"$ref": "#/definitions/keys-of-a-node"}]}
    if key.name == "identity":
        return {"anyOf": [{"$ref": "#/definitions/identity"}, {"type": "null"}]}
    return _mapping(Where(key.name), kind=_TABLE)


_PDO_NUMBER = r"0*([1-9][0-9]?|[1-4][0-9]{2}|50[0-9]|51[0-2])"
_SUB_INDEX = r"^([1-9][0-9]?|1[0-9]{2}|2[0-4][0-9]|25[0-4])$"
_OBJECT: Schema = {"type": ["string", "number"]}
_PINS: Schema = {"type": _TABLE, "propertyNames": {"pattern": _SUB_INDEX}, "additionalProperties": _OBJECT}
_OBJECTS = r"^[0-9A-F]{4}(-[0-9A-F]{4})?(:[0-9A-F]{2}(-[0-9A-F]{2})?)?$"
_MEANING: Schema = {"anyOf": [{"type": "string", "pattern": r"\S"}, {"type": "object", "minProperties": 1}]}
#: what is the same whatever the key
_PLAIN: dict[Kind, Schema] = {
    Kind.ANYTHING: {},
    Kind.TRUTH: {"type": "boolean"},
    Kind.TEXT: {"type": "string", "pattern": r"\S"},
    Kind.OBJECT: _OBJECT,
    Kind.VALUE: {"type": ["string", "number", "boolean"]},
    Kind.NODES: {"type": _TABLE, "additionalProperties": {"$ref": "#/definitions/node"}},
    Kind.PINS: {"type": _TABLE, "additionalProperties": _PINS},
    Kind.MEANINGS: {"type": _TABLE, "propertyNames": {"pattern": _OBJECTS}, "additionalProperties": _MEANING},
    Kind.ENTRIES: {"type": "array", "items": {"anyOf": [_OBJECT, {"$ref": "#/definitions/entry"}]}},
    Kind.VALUES: _list_of("sdo"),
    Kind.LINKS: _list_of("link"),
    Kind.ENDPOINT: _endpoint("tT"),
    Kind.ENDPOINTS: {"anyOf": [_endpoint("rR"), {"type": "array", "items": _endpoint("rR"), "minItems": 1}]},
}
_TYPES: dict[Kind, Callable[[NetworkKey], Schema]] = {
    Kind.INTEGER: _whole,
    Kind.MODULES: lambda key: {"type": "array", "items": _whole(key)},
    Kind.NUMBER: lambda key: {"type": "number", "minimum": key.low, "maximum": key.high},
    Kind.COB_ID: _cob_id,
    Kind.STORE: lambda key: {"anyOf": [{"type": "boolean"}, {"enum": [*STORE_WORDS]}, _whole(key)]},
    Kind.WATCH: lambda key: {"anyOf": [{"type": "boolean"}, {"type": "object", "additionalProperties": _whole(key)}]},
    Kind.HEARTBEAT: lambda key: {"anyOf": [{"const": False}, _whole(key)]},
    Kind.NUMBERS: lambda key: {
        "type": _TABLE,
        "propertyNames": {"pattern": _SUB_INDEX},
        "additionalProperties": _whole(key),
    },
    Kind.PDOS: _pdos,
    Kind.TABLE: _table_of,
}

assert {key.where for key in KEYS} == _PLACES.keys()
