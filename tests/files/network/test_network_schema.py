"""The JSON schema says what the reader says: it is what the table has, takes what is read, and refuses what is not."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

import pytest
from hypothesis import given
from ruamel.yaml import YAML

from dvtcli.domain.network.network_config import NetworkConfig
from dvtcli.errors import InputFileError
from dvtcli.files.network.network_keys import KEYS, NetworkKey, Where
from dvtcli.files.network.read_network import read_network
from dvtcli.files.network.write_network import write_network
from tests.documentation.reference import REWRITE
from tests.documentation.reference.network import SCHEMA_FILES, schema_text
from tests.files.network.key_fixtures import FIXTURES, in_node
from tests.files.network.test_read_network import TREES
from tests.files.network.test_write_network import networks
from tests.process import ROOT

#: values as YAML writes them, for a key that takes some of them
VALUES = (
    "0", "1", "-1", "3", "300", "0x10000", "0x1FFFFFFF", "0x20000000", "0x80000181", "0x100000000", "1.5", "true",
    "false", "~", '"x"', '"true"', "auto", "all", "[]", "[1]", "[x, 6041]", "[true]", "{}", "{1: 5}", "{1: {}}",
    "{600: 5}", "{1: -1}", "{1: {1: 2120}}", "{index: 1}", "[{index: 0x6041}]", "[{index: 1, object: x, value: 1}]",
    "[{indx: 1}]", "one:tpdo1", "one:rpdo1", "one:tpdo513", "[one:rpdo1]", "[{from: one:tpdo1, to: one:rpdo2}]",
    "[{from: one:tpdo1}]", "{enabled: true}", "{vendor: 1}", "{vender: 1}",
)  # fmt: skip


@cache
def validator() -> Any:
    import jsonschema  # here, as it takes seconds, and every worker reads this file

    schema = json.loads(SCHEMA_FILES[0].read_text("utf-8"))
    jsonschema.Draft7Validator.check_schema(schema)
    return jsonschema.Draft7Validator(schema)


def loaded(text: str) -> Any:
    """*text* as an editor hands it to a schema: keys are texts."""
    return _keys_as_text(YAML(typ="safe", pure=True).load(text))


def _keys_as_text(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _keys_as_text(one) for key, one in value.items()}
    return [_keys_as_text(one) for one in value] if isinstance(value, list) else value


def is_read(text: str) -> bool:
    try:
        read_network(text, "net.yaml")
    except InputFileError:
        return False
    return True


@pytest.mark.parametrize("path", SCHEMA_FILES, ids=lambda path: path.parent.name)
def test_the_published_schema_is_what_the_table_has(path: Any) -> None:
    assert path.read_text("utf-8") == schema_text(), REWRITE


@pytest.mark.parametrize("path", sorted((ROOT / "examples").glob("*.y*ml")), ids=lambda path: path.name)
def test_examples_fit_the_schema(path: Any) -> None:
    validator().validate(loaded(path.read_text("utf-8")))


@pytest.mark.parametrize("key", FIXTURES, ids=lambda key: f"{key[0]}-{key[1]}")
def test_what_is_read_fits_the_schema(key: tuple[Where, str]) -> None:
    validator().validate(loaded(FIXTURES[key][0]))


def file_with(key: NetworkKey, value: str) -> str:
    """A file that is right but for the *value* of *key*."""
    said, one = f"{key.name}: {value}", in_node("")
    beside = "" if key.name in ("index", "object") else "index: 5, "
    ends = {"from": "one:tpdo1", "to": "one:rpdo1"} | {key.name: value}
    link = ", ".join(f"{name}: {end}" for name, end in ends.items())
    if key.name == "node_id" and key.where is Where.NODE:
        return f"nodes: {{one: {{{said}}}}}"
    return {
        Where.FILE: f"{said}\n{one if key.name != 'nodes' else ''}",
        Where.NODE: in_node(said),
        Where.TPDO: in_node(f"tpdo: {{1: {{{said}}}}}"),
        Where.RPDO: in_node(f"rpdo: {{1: {{{said}}}}}"),
        Where.IDENTITY: in_node(f"identity: {{{said}}}"),
        Where.ENTRY: in_node(f"tpdo: {{1: {{mapping: [{{{beside}{said}}}]}}}}"),
        Where.SDO: in_node(f"sdo: [{{{beside}{said}}}]"),
        Where.LINK: f"links: [{{{link}}}]\n{one}",
    }.get(key.where, f"{key.where}: {{{said}}}\n{one}")


#: what is wrong, and only the reader sees it: names of nodes, no node at all, a malformed object, a misspelt key or
#: a key at the level of another, a stamp that is not stored
READER_ONLY = {
    (Where.NODE, "heartbeat_consumer"): ("{600: 5}", "{index: 1}", "{vendor: 1}", "{vender: 1}"),
    (Where.FILE, "nodes"): ("~", "{}"),
    (Where.NODE, "stamp"): ("true",),
    (Where.FILE, "defaults"): ("{vendor: 1}", "{enabled: true}"),
    (Where.SDO, "object"): ("0x10000", "0x1FFFFFFF", "0x20000000", "0x80000181", "0x100000000"),
}


@pytest.mark.drawn(20)
@pytest.mark.parametrize("key", KEYS, ids=lambda key: f"{key.where}-{key.name}")
def test_reader_and_schema_agree_about_every_value(key: NetworkKey) -> None:
    for value in VALUES:
        text = file_with(key, value)
        fits, read = validator().is_valid(loaded(text)), is_read(text)
        reader_only = value in READER_ONLY.get((key.where, key.name), ())
        assert (fits, read) == (True, False) if reader_only else fits == read, (text, value, fits, read)


def test_a_node_id_is_no_default() -> None:
    assert not is_read(f"{in_node('')}defaults: {{node_id: true}}\n")
    assert not is_read(f"{in_node('')}defaults: {{node_id: 7}}\n")


@given(TREES)
def test_whatever_is_read_fits_the_schema(tree: str) -> None:
    text = f"{in_node('')}defaults: {tree}\n"
    if "!t" not in text and "<<" not in text and is_read(text):
        assert validator().is_valid(loaded(text)), text


@given(networks())
def test_what_is_written_fits_the_schema(config: NetworkConfig) -> None:
    text = write_network(config)
    assert validator().is_valid(loaded(text)), text
