"""Network files: every key is read as its table says, everything wrong is said at once, and nothing else comes out."""

from __future__ import annotations

import warnings
from pathlib import Path
from textwrap import dedent

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.network.network_config import (
    FileWord,
    HeartbeatWatch,
    Mark,
    NetworkConfig,
    NodeConfig,
    PartialPdoConfig,
    ValueConfig,
)
from dvtcli.domain.rules.finding import FileComplaint
from dvtcli.errors import InputFileError
from dvtcli.files.network.network_keys import KEYS, NetworkKey, Where
from dvtcli.files.network.read_network import read_network, read_network_file
from tests.files.network.key_fixtures import FIXTURES, TPDO1, in_node, only, read
from tests.process import ROOT

#: keys of drivers and packages that read the same files
FOREIGN = (
    "driver", "package", "namespace", "period", "polling", "boot_timeout", "boot_timeout_ms", "sdo_timeout_ms",
    "remappings", "enable_lazy_load", "register_map", "motor_channels", "diagnostics", "joint_name", "switching_state",
    "position_mode", "velocity_mode", "homing_timeout_seconds", "scale_pos_to_dev", "scale_vel_from_dev",
    "offset_pos_to_dev", "homing_enabled", "default_operation_mode", "state_switch_timeout_ms", "enable_ros_interfaces",
)  # fmt: skip


def wrong(text: str) -> list[tuple[int, int, str]]:
    """Line, column and text of all that is wrong in a dedented *text*."""
    with pytest.raises(InputFileError) as raised:
        read_network(dedent(text), "net.yaml")
    return [(one.line, one.column, one.text) for one in raised.value.complaints]


def test_every_key_has_a_fixture() -> None:
    assert {(key.where, key.name) for key in KEYS} == FIXTURES.keys()


@pytest.mark.parametrize("key", FIXTURES, ids=lambda key: f"{key[0]}-{key[1]}")
def test_a_key_is_read(key: tuple[Where, str]) -> None:
    text, get, wanted = FIXTURES[key]
    assert get(read_network(text, "net.yaml")) == wanted


@pytest.mark.parametrize("name", FOREIGN)
@pytest.mark.parametrize("value", ["1", "{a: [1, 2]}", '"x"', ""])
def test_keys_of_other_tools_are_noted(name: str, value: str) -> None:
    (note,) = read(in_node(f"{name}: {value}")).notes
    assert (note.mark, name in note.text) == (Mark(4, 5, len(name)), True)


def _slips(key: str) -> list[str]:
    """*key* with one slip of each kind: of case, of a hyphen, a swap, and a character less, more and other."""
    swapped = [key[:at] + key[at + 1] + key[at] + key[at + 2 :] for at in range(len(key) - 1)]
    dropped = [key[:at] + key[at + 1 :] for at in range(len(key)) if len(key) > 3]
    typed = [key[:at] + "0" + key[at + 1 :] for at in range(1, len(key))]
    doubled = [key[:at] + key[at] + key[at:] for at in range(len(key))]
    cased = [key.upper(), key.capitalize(), key.replace("_", "-"), key.title().replace("_", "")]
    return [slip for slip in dict.fromkeys([*cased, *swapped, *dropped, *typed, *doubled]) if slip != key]


@pytest.mark.parametrize(
    ("where", "key"),
    [
        (key.where, key.name)
        for key in KEYS
        if key.where in (Where.FILE, Where.OPTIONS, Where.MASTER, Where.NODE) and not key.noted
    ],
)
def test_a_slip_of_a_key_is_an_error_wherever_keys_of_other_tools_may_stand(where: Where, key: str) -> None:
    own = {name.name for name in KEYS if name.where is where}
    for slip in _slips(key):
        if slip in own or slip == "baud_rate":
            continue
        text = {
            Where.FILE: f"{slip}: 1\nnodes: {{a: {{node_id: 3, guard_time: x}}}}\n",
            Where.NODE: f"nodes: {{a: {{node_id: 3, {slip}: 1, guard_time: x}}}}\n",
        }.get(where, f"{where}: {{{slip}: 1}}\nnodes: {{a: {{node_id: 3, guard_time: x}}}}\n")
        said = [found for _, _, found in wrong(text)]
        assert any(found.startswith(f"unknown key {slip!r} in") and "did you mean" in found for found in said), said
        assert any("whole number" in found for found in said)


@pytest.mark.parametrize("key", [key for key in KEYS if key.where in (Where.TPDO, Where.RPDO) and not key.noted])
def test_a_key_of_a_pdo_at_another_level_is_an_error_that_says_where_it_belongs(key: NetworkKey) -> None:
    for name in (key.name, key.name.title()):
        for text in (f"{name}: 1", f"{key.where}: {{1: , {name}: 1}}"):
            assert any(f"{name!r} in" in found and "belongs to a PDO" in found for *_, found in wrong(in_node(text)))
        assert "belongs to a PDO" in wrong(f"{name}: 1\nnodes: {{a: {{node_id: 3}}}}\n")[0][2]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("heartbeat_producer: 5\nnodes: {a: {node_id: 3}}\n", "'heartbeat_producer' in this file belongs to a node"),
        ("store: true\na: {node_id: 3}\n", "'store' in this file belongs to a node"),
        ("Tpdo: {1: {}}\na: {node_id: 3}\n", "'Tpdo' in this file belongs to a node"),
        ("baudrate: 500\nnodes: {a: {node_id: 3}}\n", "'baudrate' in this file belongs to master"),
        ("nodes: {a: {node_id: 3, links: []}}\n", "'links' in node a belongs to the file"),
        ("nodes: {a: {node_id: 3, tpdo: {1: {sdo: []}}}}\n", "'sdo' in TPDO1 of node a belongs to a node"),
        ("mastr: {node_id: 9}\nnodes: {a: {node_id: 3}}\n", "unknown key 'mastr' in this file, did you mean 'master'?"),
        ("Master: {node_id: 9}\na: {node_id: 3}\n", "unknown key 'Master' in this file, did you mean 'master'?"),
    ],
)
def test_a_key_at_the_level_of_another_is_an_error(text: str, says: str) -> None:
    assert says in wrong(text)[0][2]


@pytest.mark.parametrize("name", ["node1", "link", "default", "master2", "master_b", "option", "drive"])
def test_a_node_at_the_top_level_may_have_nearly_any_name(name: str) -> None:
    assert {node.name for node in read(f"{name}: {{node_id: 3}}\na: {{node_id: 4}}\n").nodes} == {name, "a"}


def test_all_that_is_wrong_is_said_at_once_with_its_place() -> None:
    text = """\
        nodes:
          left:
            node_id: 200
            tpdo:
              1:
                enabled: "false"
                inhibt_time: 10
                cob_id: "0x181"
              1: {}
              513: {}
          right: {node_id: 3, heartbeat: 3, tpdo: {2: {cob_id: 0x12345, mapping: , inhibit_ms: 0.15}}}
          mid: {node_id: 3, guard_time: 010}
        lnks: []
        """
    assert [(line, column) for line, column, _ in wrong(text)] == [
        (3, 14), (6, 18), (7, 9), (8, 17), (9, 7), (10, 7), (11, 23), (11, 56), (11, 73), (11, 88), (12, 18), (12, 33),
        (13, 1),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("tpdo: {1: {inhibt_time: 1}}", "unknown key 'inhibt_time' in TPDO1 of node one, did you mean 'inhibit_time'?"),
        ("tpdo1: {enabled: true}", "did you mean 'tpdo'?"),
        ("heartbeat: 500", "did you mean 'heartbeat_producer'?"),
        ('tpdo: {1: {enabled: "false"}}', 'true or false is expected here, not "false"; a text is not a truth value'),
        ("tpdo: {1: {enabled: no}}", 'true or false is expected here, not "no"'),
        ("tpdo: {1: {enabled: 1}}", "true or false is expected here, not 1"),
        ('tpdo: {1: {cob_id: "0x181"}}', 'not "0x181"; it is written without quotes'),
        ("tpdo: {1: {cob_id: keep}}", "a whole number is expected here"),
        ("tpdo: {1: {cob_id: 0x100000000}}", "0x100000000 is not within 0x0…0xFFFFFFFF"),
        ("tpdo: {1: {cob_id: 0x40000181, rtr_allowed: true}}", "bit 30 of cob_id forbids RTR"),
        ("tpdo: {1: {transmission: 256}}", "256 is not within 0…255"),
        ("tpdo: {1: {inhibit_time: 65536}}", "65536 is not within 0…65535 × 100 µs"),
        ("tpdo: {1: {inhibit_time: 1, inhibit_ms: 1}}", "are the same: give only one of them"),
        ("tpdo: {1: {inhibit_ms: .nan}}", "a number is expected here, not .nan"),
        ("tpdo: {1: {event_timer: 1.5}}", "a whole number is expected here, not 1.5"),
        ("tpdo: {1: {event_timer: 017}}", "017 is 15 for some readers and 17 for others"),
        ("tpdo: {1: {event_timer: 1_000}}", "'1_000' is not a number; write it in decimal or as 0x…"),
        ("rpdo: {1: {inhibit_ms: 1}}", "unknown key 'inhibit_ms' in RPDO1 of node one"),
        ("tpdo: {0: {}}", "'0' is not a PDO number: 1…512"),
        ("tpdo: {one: {}}", "'one' is not a PDO number: 1…512"),
        ("tpdo: {1: {}, 0x1: {}}", "TPDO1 of node one was given twice (first at line 4)"),
        ("tpdo: {1: {mapping: }}", "a list is expected here, not nothing; [] for none"),
        ("tpdo: {1: {mapping: 6041}}", "a list is expected here, not 6041"),
        ("tpdo: {1: {mapping: [0x60411]}}", "an index has four hexadecimal digits"),
        ("tpdo: {1: {mapping: [6041/65]}}", "a length in bits, 1…64"),
        ("tpdo: {1: {mapping: [true]}}", "an object is expected here, not true"),
        ("tpdo: {1: {mapping: [{sub_index: 1}]}}", "an object of TPDO1 of node one has no index"),
        ("tpdo: {1: {mapping: [{index: 0x6041, sub: 1}]}}", "did you mean 'sub_index'?"),
        ("tpdo: [1]", "keys and values belong here, not a list"),
        ("sdo: {index: 1}", "a list is expected here, not a mapping"),
        ("sdo: [{index: 0x6081, object: 6081, value: 1}]", "object and index are the same"),
        ("sdo: [{value: 1}]", "has neither index nor object"),
        ("sdo: [{index: 0x6081, value: [1]}]", "a value is expected here, not a list"),
        ("sdo: [{index: 0x6081, value: }]", "a value is expected here, not nothing"),
        ("sdo: [{index: 0x6081, value: 1}, {object: 6081:00, value: 2}]", "6081:00 has a value already (line 4)"),
        (
            "{heartbeat_producer: 5, sdo: [{index: 0x1017, value: 1}]}",
            "is already set by heartbeat_producer of this node",
        ),
        ("identity: {vender: 1}", "did you mean 'vendor'?"),
        ("{vendor_id: 1, identity: {vendor: 2}}", "vendor_id is not what identity says of vendor"),
        ("heartbeat_consumer: {two: 5}", "'two' is not a node of this file, and no node-ID: 1…127"),
        ("heartbeat_consumer: {one: 5, 5: 6}", "node 5 is watched twice"),
        ("heartbeat_consumer: 5", "true or false is expected here, not 5"),
        ("error_behavior: {0: 1}", "is not a sub-index of 0x1029: 1…254"),
        ("vpdo: {motor: {1: none, 0x1: none}}", "pin 1 of motor was given twice"),
        ("store: yes", "true, false, all, communication, application or a sub-index is expected here"),
        ("store: 200", "200 is not within 1…127"),
        ("profile: 402", "a text is expected here, not 402"),
        ('dcf: " "', "a text is expected here"),
        ("dcf: !include x", "the tag !include has no meaning here"),
    ],
)
def test_what_is_wrong_in_a_node_is_said(text: str, says: str) -> None:
    if text.startswith("{"):
        text = text[1:-1].replace(", sdo", "\nsdo").replace(", identity", "\nidentity")
    assert any(says in found for _, _, found in wrong(in_node(text))), wrong(in_node(text))


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        ("", 1, "a network is written as keys and values"),
        ("- a\n", 1, "a network is written as keys and values"),
        ("master: {node_id: 1}\n", 1, "no node is in this file"),
        ("a: {dcf: x.eds}\n", 1, "node a has no node_id"),
        ("a: {node_id: 1}\nb: {node_id: 1}\n", 2, "node-ID 1 is that of a already"),
        ("master: {node_id: 1}\na: {node_id: 1}\n", 2, "node-ID 1 is that of the master already"),
        ("a: {node_id: 1}\na: {node_id: 2}\n", 2, "'a' occurs twice (first at line 1)"),
        ("nodes: {a: {node_id: 1}}\na: {node_id: 2}\n", 2, "node a occurs twice (first at line 1)"),
        ("nodes: {5: {node_id: 5}}\n", 1, "'5' is not a name: give the node a name and node_id: 5"),
        ("nodes: {'a:b': {node_id: 5}}\n", 1, "'a:b' is not a name: a node is called by a word without a colon"),
        ("nodes: {a: 5}\n", 1, "keys and values of node a belong here, not 5"),
        ("defualts: {prune: true}\na: {node_id: 1}\n", 1, "did you mean 'defaults'?"),
        ("a:\n\tnode_id: 1\n", 2, "not YAML: use spaces in place of this tab"),
        ("a: 1\n b: 2\n", 2, "not YAML: mapping values are not allowed here"),
        ("a: {node_id: 1}\n---\nb: {}\n", 2, "not YAML: but found another document"),
        ("a: &x {<<: *x}\n", 1, "an alias stands inside of what it repeats"),
        ("a: {node_id: 1, x: {y: 1, y: 2}}\n", 1, "'y' occurs twice (first at line 1)"),
        ("a: {? [1] : 2, node_id: 1}\n", 1, "a key is one word"),
        ("a: {<<: 5, node_id: 1}\n", 1, "<< needs mappings"),
        ("a: {node_id: 1, x: \x07}\n", 1, "not YAML"),
        ("a: " + "{a: " * 3000, 1, "nested too deep"),
        ("a: {node_id: 1}\nlinks: [{from: a:rpdo1, to: a:rpdo1}]\n", 2, "a link goes from a TPDO to RPDOs"),
        ("a: {node_id: 1}\nlinks: [{from: b:tpdo1, to: a:rpdo1}]\n", 2, "this file has no node 'b'"),
        ("io: {node_id: 1}\nlinks: [{from: oi:tpdo1, to: io:rpdo1}]\n", 2, "no node 'oi', did you mean 'io'?"),
        ("drive: {node_id: 1}\nlinks: [{from: drvie:tpdo1, to: 1:rpdo1}]\n", 2, "'drvie', did you mean 'drive'?"),
        ("a: {node_id: 1}\nlinks: [{from: a tpdo1, to: a:rpdo1}]\n", 2, 'NODE:tpdoN is expected here, not "a tpdo1"'),
        ("a: {node_id: 1}\nlinks: [{from: a:tpdo1}]\n", 2, "a link has no to"),
        ("a: {node_id: 1}\nlinks: [{from: a:tpdo1, to: []}]\n", 2, "a link needs an RPDO"),
        ("a: {node_id: 1}\nlinks: [{from: a:tpdo0, to: a:rpdo1}]\n", 2, "PDO numbers are 1..512"),
        ("a: {node_id: 1}\nlinks: [{from: a:tpdo1, to: a:rpdo1}, {from: a:tpdo2, to: 1:rpdo1}]\n", 2,
         '"1:rpdo1" receives another TPDO already (line 2)'),
    ],
)  # fmt: skip
def test_what_is_wrong_in_a_file_is_said(text: str, line: int, says: str) -> None:
    assert any(place == line and says in found for place, _, found in wrong(text)), wrong(text)


def test_a_time_of_the_other_direction_is_left_alone_and_its_key_is_named() -> None:
    notes = [
        read(in_node(text)).notes[0].text for text in ("rpdo: {1: {event_timer: 5}}", "tpdo: {1: {event_deadline: 5}}")
    ]
    assert notes == [
        "event_timer is ignored: set on a TPDO only; event_deadline is the time of an RPDO",
        "event_deadline is ignored: set on an RPDO only; event_timer is the time of a TPDO",
    ]


def test_absent_keys_leave_everything_alone() -> None:
    config = PartialPdoConfig(TPDO1, inhibit_time=400, event_timer=50)
    assert only("tpdo: {1: {inhibit_time: 400, event_timer: 50}}") == NodeConfig("one", 5, pdos=(config,))


def test_defaults_are_overridden_key_by_key() -> None:
    config = read("""\
        defaults:
          heartbeat_producer: 1000
          sdo: [{index: 0x6081, value: 1}]
          tpdo: {1: {transmission: 1, inhibit_time: 5}, 2: {enabled: false}}
        nodes:
          a: {node_id: 2, tpdo: {1: {transmission: 2, inhibit_ms: 1}}, sdo: [{index: 0x6082, value: 2}]}
        """)
    (node,) = config.nodes
    assert [pdo.transmission_type for pdo in node.pdos] == [2, None]
    assert (node.pdos[0].inhibit_time, node.pdos[1].enabled) == (10, False)
    assert (node.objects[0].data, [one.object.text for one in node.values]) == (b"\xe8\x03", ["6082:00"])
    assert (node.pdos[0].mark.line, node.pdos[1].mark.line, node.objects[0].mark.line) == (6, 4, 2)


def test_what_defaults_have_wrong_is_said_once() -> None:
    found = wrong("defaults: {guard_time: x}\na: {node_id: 2}\nb: {node_id: 3}\n")
    assert [(line, column) for line, column, _ in found] == [(1, 24)]


def test_an_anchor_may_be_set_again() -> None:
    """As YAML has it: nothing of the library that reads it is shown for that."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = read_network("a: &x {node_id: 5}\nb: &x {node_id: 6}\n.c: *x\n", "x.yaml")
    assert [node.node_id for node in found.nodes] == [5, 6]


def test_anchors_and_keys_with_a_dot_are_for_sharing() -> None:
    config = read(".x: &x {prune: true, stamp: true, store: true}\na: {<<: *x, node_id: 2, stamp: false}\n")
    assert config.nodes == (NodeConfig("a", 2, prune=True, stamp=False, store="all"),)


def test_an_unset_heartbeat_clears_no_entry_and_a_false_one_does() -> None:
    master = "master: {node_id: 1, heartbeat_producer: 200}\n"
    assert read(f"{master}a: {{node_id: 2}}").nodes[0].watches == ()
    assert read(f"{master}a: {{node_id: 2, heartbeat_consumer: false}}").nodes[0].watches == (HeartbeatWatch(1, 0),)
    assert read(f"{master}a: {{node_id: 2, heartbeat_consumer: true}}").nodes[0].watches == (HeartbeatWatch(1, 600),)


def test_whom_to_watch_is_not_guessed() -> None:
    config = read("a: {node_id: 2, heartbeat_consumer: true}")
    assert (config.nodes[0].watches, config.notes[0].text.partition(":")[0]) == ((), "heartbeat_consumer is ignored")
    assert (
        "65535 is the most"
        in wrong("master: {node_id: 1, heartbeat_producer: 60000}\na: {node_id: 2, heartbeat_consumer: true}\n")[0][2]
    )


@pytest.mark.parametrize(
    ("said", "config"),
    [
        ("cob_id: 0x80000181", PartialPdoConfig(TPDO1, enabled=False, cob_id=0x181)),
        ("cob_id: 0x80000000", PartialPdoConfig(TPDO1, enabled=False)),
        ("cob_id: 0xC0000181, enabled: true", PartialPdoConfig(TPDO1, enabled=False, cob_id=0x181, rtr_allowed=False)),
        ("cob_id: 0x20012345", PartialPdoConfig(TPDO1, cob_id=0x12345, extended=True)),
        ("cob_id: 385", PartialPdoConfig(TPDO1, cob_id=0x181)),
    ],
)
def test_a_cob_id_is_taken_with_its_bits(said: str, config: PartialPdoConfig) -> None:
    assert only(f"tpdo: {{1: {{{said}}}}}").pdos == (config,)


def test_objects_in_a_mapping_are_hexadecimal_as_at_the_prompt() -> None:
    words = "[6041, 0x6041, 60E1, 6041:00/16, 'Analogue input 1', dummy/16, {index: 0x6041}]"
    (pdo,) = only(f"tpdo: {{1: {{mapping: {words}}}}}").pdos
    assert [word.text for word in pdo.mapping or ()] == [
        "6041", "0x6041", "60E1", "6041:00/16", "Analogue input 1", "dummy/16", "6041:00",
    ]  # fmt: skip


def test_a_value_without_one_is_0_as_for_dcfgen() -> None:
    assert only("sdo: [{index: 0x6081}]").values[0].value == FileWord("0")


@pytest.mark.parametrize("path", sorted((ROOT / "examples").glob("*.y*ml")), ids=lambda path: path.name)
def test_examples_are_read(path: Path) -> None:
    assert read_network_file(path).nodes


def test_a_file_that_is_no_text_is_said(tmp_path: Path) -> None:
    (tmp_path / "net.yaml").write_bytes(b"a: \xff\n")
    with pytest.raises(InputFileError, match="not UTF-8"):
        read_network_file(tmp_path / "net.yaml")
    (tmp_path / "net.yaml").write_bytes(b"\xef\xbb\xbfa: {node_id: 2}\r\n")
    assert read_network_file(tmp_path / "net.yaml").nodes == (NodeConfig("a", 2),)


KEY_WORDS = st.sampled_from([*sorted({key.name for key in KEYS}), "a", "1", "<<", ".x"])
TREES = st.recursive(
    st.sampled_from(["1", "0x7F", "true", '"x"', "auto", "6041", "~", "1.5", "a:tpdo1", "-1", "!t x"]),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3).map(lambda items: f"[{', '.join(items)}]"),
        st.dictionaries(KEY_WORDS, inner, max_size=4).map(
            lambda items: "{" + ", ".join(f"{key}: {value}" for key, value in items.items()) + "}"
        ),
    ),
    max_leaves=12,
)


@given(st.dictionaries(KEY_WORDS, TREES, max_size=4), st.text(alphabet="{}[]:,&*!|>'\"# \n-a1", max_size=20))
def test_any_text_is_a_wish_or_an_input_file_error(keys: dict[str, str], noise: str) -> None:
    text = "".join(f"{key}: {value}\n" for key, value in keys.items()) + noise
    config: NetworkConfig | None = None
    found: tuple[FileComplaint, ...] = ()
    try:
        config = read_network(text, "net.yaml")
    except InputFileError as error:
        found = error.complaints
    assert bool(found) != bool(config and config.nodes)
    assert found == tuple(sorted(found))
    assert all(one.line >= 1 and one.column >= 1 and one.width >= 1 for one in found)


@pytest.mark.parametrize("digits", ["0", "", "0x", "-0"])
@pytest.mark.parametrize(
    "key", ["heartbeat_producer: {}", "tpdo: {{{}: {{}}}}", "tpdo: {{1: {{inhibit_ms: {}}}}}", "store: {}"]
)
def test_a_number_of_any_length_is_a_complaint(key: str, digits: str) -> None:
    """Python turns no more than 4300 digits into a number."""
    text = in_node(key.format(digits + "1" * 5001))
    assert wrong(text)


def test_more_nodes_than_a_network_has_are_refused_before_defaults_are_laid_under_them() -> None:
    defaults = "defaults: {tpdo: {1: {event_timer: 5}}}\n"
    text = defaults + "".join(f"n{number}: {{node_id: {number}}}\n" for number in range(1, 129))
    with pytest.raises(InputFileError) as refused:
        read_network(text, "net.yaml")
    assert [one.text for one in refused.value.complaints] == ["128 nodes are in this file, and a network has 127"]


def test_each_requested_object_has_its_place() -> None:
    """A finding about an object is shown at the key or the word that asks for it."""
    (node,) = read("""\
        a:
          node_id: 2
          heartbeat_producer: 500
          product_code: 7
          tpdo:
            1:
              transmission: 1
              mapping:
                - 6041
                - 6061
          rpdo:
            2: {mapping: [dummy/8, 6060]}
          sdo:
            - {index: 0x6081, value: 1}
        """).nodes
    assert {place: mark.line for place, mark in node.marks.items()} == {
        (0x1017, 0): 3, (0x1018, 2): 4, (0x1800, 2): 7, (0x1A00, 0): 8, (0x1A00, 1): 9, (0x1A00, 2): 10,
        (0x1601, 0): 12, (0x6081, 0): 14,
    }  # fmt: skip


@pytest.mark.parametrize("name", ["Target position", "6C011:1"])
def test_a_value_whose_object_is_a_name_or_malformed_has_no_place(name: str) -> None:
    values = tuple(ValueConfig(FileWord(word, Mark(4)), FileWord("1")) for word in (name, "6081:00"))
    assert NodeConfig("a", 2, values=values).marks == {(0x6081, 0): Mark(4)}
