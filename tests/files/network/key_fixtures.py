"""One small file for each key of a network file, and what is read from it."""

from __future__ import annotations

from collections.abc import Callable
from textwrap import dedent

from dvtcli.domain.network.network_config import (
    Endpoint,
    ExpectedIdentity,
    FileWord,
    HeartbeatWatch,
    LinkConfig,
    MasterRole,
    NetworkConfig,
    NodeConfig,
    ObjectConfig,
    PartialPdoConfig,
    PinConfig,
    ValueConfig,
)
from dvtcli.domain.pdo import Pdo
from dvtcli.files.network.network_keys import Where
from dvtcli.files.network.read_network import read_network

TPDO1, RPDO1 = Pdo.parse("tpdo1"), Pdo.parse("rpdo1")
_MASTER = "master: {node_id: 1, heartbeat_producer: 200}\n"
Fixture = tuple[str, Callable[[NetworkConfig], object], object]


def read(text: str) -> NetworkConfig:
    """The wish of a dedented *text*."""
    return read_network(dedent(text), "net.yaml")


def only(text: str) -> NodeConfig:
    """The one node of a file whose node has *text* as its keys."""
    (node,) = read_network(in_node(text), "net.yaml").nodes
    return node


def in_node(text: str) -> str:
    """A file with a node of node-ID 5 and the keys of *text*."""
    body = "".join(f"    {line}\n" for line in dedent(text).strip().splitlines())
    return f"nodes:\n  one:\n    node_id: 5\n{body}"


def _node(text: str, **wanted: object) -> Fixture:
    return in_node(text), lambda config: config.nodes[0], NodeConfig("one", 5, **wanted)  # type: ignore[arg-type]


def _pdo(text: str, pdo: Pdo = TPDO1, **wanted: object) -> Fixture:
    config = PartialPdoConfig(pdo, **wanted)  # type: ignore[arg-type]
    return in_node(f"{pdo.direction}: {{{pdo.number}: {{{text}}}}}"), lambda found: found.nodes[0].pdos[0], config


def _object(text: str, index: int, sub_index: int, data: bytes) -> Fixture:
    return _node(text, objects=(ObjectConfig(text.partition(":")[0], index, sub_index, data),))


def _value(text: str, name: str, value: str) -> Fixture:
    return _node(f"sdo: [{{{text}}}]", values=(ValueConfig(FileWord(name), FileWord(value)),))


def _left_alone(text: str, where: str = "node") -> Fixture:
    closing = "}" * where.count("{")
    file = in_node(text) if where == "node" else f"{where}: {{{text}}}{closing}\n{in_node('prune: true')}"
    key = text.partition(":")[0]
    return file, lambda config: any(note.text.startswith(f"{key} is ignored") for note in config.notes), True


def _of_the_master(text: str) -> Fixture:
    return f"master: {{node_id: 1, {text}}}\n{in_node('')}", lambda config: config.master, MasterRole(1)


def _file(text: str, get: Callable[[NetworkConfig], object], wanted: object) -> Fixture:
    return dedent(text), get, wanted


_TWO = "nodes: {a: {node_id: 2}, b: {node_id: 3}, c: {node_id: 4}}\n"
_FROM_A = Endpoint(2, TPDO1)
_TO_B, _TO_C = Endpoint(3, RPDO1), Endpoint(4, Pdo.parse("rpdo2"))

FIXTURES: dict[tuple[Where, str], Fixture] = {
    (Where.FILE, "nodes"): _file("nodes: {a: {node_id: 2}}", lambda config: config.nodes, (NodeConfig("a", 2),)),
    (Where.FILE, "defaults"): _file(
        "defaults: {prune: true, store: all}\na: {node_id: 2, store: false}", lambda config: config.nodes,
        (NodeConfig("a", 2, prune=True, store=False),),
    ),
    (Where.FILE, "links"): _file(
        f"{_TWO}links:\n- {{from: a:tpdo1, to: [b:rpdo1, 4:rpdo2], heartbeat: false}}", lambda config: config.links,
        (LinkConfig(_FROM_A, (_TO_B, _TO_C), heartbeat=False),),
    ),
    (Where.FILE, "master"): _file("master: {node_id: 9}\na: {node_id: 2}", lambda config: config.master, MasterRole(9)),
    (Where.FILE, "options"): _file("options: {}\na: {node_id: 2}", lambda config: config.nodes, (NodeConfig("a", 2),)),
    (Where.OPTIONS, "heartbeat_multiplier"): _file(
        f"options: {{heartbeat_multiplier: 1.5}}\n{_MASTER}a: {{node_id: 2, heartbeat_consumer: true}}",
        lambda config: config.nodes[0].watches, (HeartbeatWatch(1, 300),),
    ),
    (Where.OPTIONS, "dcf_path"): _left_alone('dcf_path: "@BUS_CONFIG_PATH@"', "options"),
    (Where.OPTIONS, "retry_factor"): _left_alone("retry_factor: 3", "options"),
    (Where.MASTER, "node_id"): _file("master: {node_id: 255}\na: {node_id: 2}", lambda w: w.master, MasterRole()),
    (Where.MASTER, "sync_period"): _file(
        "master: {sync_period: 10000}\na: {node_id: 2}", lambda w: w.master, MasterRole(sync_period_us=10_000)
    ),
    (Where.MASTER, "heartbeat_producer"): _file(
        f"{_MASTER}a: {{node_id: 2}}", lambda config: config.master, MasterRole(1, heartbeat_producer_ms=200)
    ),
    (Where.MASTER, "baudrate"): _file(
        "master: {baudrate: 250}\na: {node_id: 2}", lambda config: config.master, MasterRole(bit_rate=250_000)
    ),
    (Where.MASTER, "heartbeat_multiplier"): _file(
        "master: {node_id: 1, heartbeat_producer: 100, heartbeat_multiplier: 2}\n"
        "a: {node_id: 2, heartbeat_consumer: true}",
        lambda config: config.nodes[0].watches, (HeartbeatWatch(1, 200),),
    ),
    **{
        (Where.MASTER, name): _of_the_master(f"{name}: {value}")
        for name, value in {
            "vendor_id": 0x360, "product_code": 1, "revision_number": 1, "serial_number": 1,
            "sync_window": 1000, "sync_overflow": 10, "time_cob_id": 0x100, "emcy_inhibit_time": 10,
            "heartbeat_consumer": "true", "error_behavior": "{1: 0}", "nmt_inhibit_time": 0, "start": "true",
            "start_nodes": "true", "start_all_nodes": "false", "reset_all_nodes": "false", "stop_all_nodes": "false",
            "boot_time": 0,
        }.items()
    },
    (Where.NODE, "node_id"): _file("a: {node_id: 0x7F}", lambda config: config.nodes, (NodeConfig("a", 127),)),
    (Where.NODE, "dcf"): _node('dcf: "@BUS_CONFIG_PATH@/a.eds"', dcf=FileWord("@BUS_CONFIG_PATH@/a.eds")),
    (Where.NODE, "eds"): _node('eds: "a.eds"', dcf=FileWord("a.eds")),
    (Where.NODE, "modules"): _node("modules: [1, 0x1, 2]", modules=(1, 1, 2)),
    (Where.NODE, "profile"): _node("profile: gen4", profile="gen4"),
    (Where.NODE, "identity"): _node("identity: {vendor: 0x1E}", identity=ExpectedIdentity(0x1E)),
    (Where.NODE, "vendor_id"): _node("vendor_id: 0x1E", identity=ExpectedIdentity(0x1E)),
    (Where.NODE, "product_code"): _node("product_code: 2", identity=ExpectedIdentity(product=2)),
    (Where.NODE, "revision_number"): _node("revision_number: 3", identity=ExpectedIdentity(revision=3)),
    (Where.NODE, "serial_number"): _node("serial_number: 0", identity=ExpectedIdentity()),
    (Where.NODE, "tpdo"): _node(
        "tpdo: {512: {enabled: false}}", pdos=(PartialPdoConfig(Pdo.parse("tpdo512"), enabled=False),)
    ),
    (Where.NODE, "rpdo"): _node("rpdo: {0x1: }", pdos=(PartialPdoConfig(RPDO1),)),
    (Where.NODE, "sdo"): _node("sdo: []"),
    (Where.NODE, "heartbeat_producer"): _object("heartbeat_producer: 1000", 0x1017, 0, b"\xe8\x03"),
    (Where.NODE, "heartbeat_consumer"): _node(
        "heartbeat_consumer: {one: 1500, 9: 0}", watches=(HeartbeatWatch(5, 1500), HeartbeatWatch(9, 0))
    ),
    (Where.NODE, "guard_time"): _object("guard_time: 200", 0x100C, 0, b"\xc8\x00"),
    (Where.NODE, "life_time_factor"): _object("life_time_factor: 3", 0x100D, 0, b"\x03"),
    (Where.NODE, "sync_cob_id"): _object("sync_cob_id: 0x40000080", 0x1005, 0, b"\x80\0\0\x40"),
    (Where.NODE, "sync_period"): _object("sync_period: 20000", 0x1006, 0, b"\x20\x4e\0\0"),
    (Where.NODE, "time_cob_id"): _object("time_cob_id: 0x80000100", 0x1012, 0, b"\x00\x01\x00\x80"),
    (Where.NODE, "error_behavior"): _node(
        "error_behavior: {1: 2}", objects=(ObjectConfig("error_behavior", 0x1029, 1, b"\x02"),)
    ),
    (Where.NODE, "physical"): _node(
        'physical: {5100:01: 1/16 V, "2000-2003": {unit: degC, factor: 0.5, offset: -40}, 6C01:02: {bits: {0: door}}}',
        physical=(
            ("2000-2003", '{"unit": "degC", "factor": "0.5", "offset": -40}'), ("5100:01", '"1/16 V"'),
            ("6C01:02", '{"bits": {"0": "door"}}'),
        ),
    ),
    (Where.NODE, "vpdo"): _node(
        "vpdo: {digital-in: {2: none, 1: 2120}}",
        pins=(PinConfig("digital-in", 1, FileWord("2120")), PinConfig("digital-in", 2, None)),
    ),
    (Where.NODE, "store"): _node("store: 4", store="4"),
    (Where.NODE, "prune"): _node("prune: true", prune=True),
    (Where.NODE, "stamp"): _node("store: true\nstamp: true", store="all", stamp=True),
    **{
        (Where.NODE, name): _left_alone(f"{name}: {value}")
        for name, value in {
            "dcf_path": "/etc", "heartbeat_multiplier": 2, "retry_factor": 3, "boot": "true", "mandatory": "true",
            "reset_communication": "false", "restore_configuration": 1, "software_file": "a.bin",
            "software_version": 2, "configuration_file": "a.bin",
        }.items()
    },
    (Where.IDENTITY, "vendor"): _node("identity: {vendor: 0x1E}", identity=ExpectedIdentity(0x1E)),
    (Where.IDENTITY, "product"): _node("identity: {product: 7}", identity=ExpectedIdentity(product=7)),
    (Where.IDENTITY, "revision"): _node("identity: {revision: 0}", identity=ExpectedIdentity(revision=0)),
    (Where.IDENTITY, "serial"): _node("identity: {serial: 9}", identity=ExpectedIdentity(serial=9)),
    (Where.TPDO, "enabled"): _pdo("enabled: false", enabled=False),
    (Where.TPDO, "cob_id"): _pdo("cob_id: auto", cob_id="auto"),
    (Where.TPDO, "rtr_allowed"): _pdo("rtr_allowed: true", rtr_allowed=True),
    (Where.TPDO, "transmission"): _pdo("transmission: 0xFE", transmission_type=254),
    (Where.TPDO, "inhibit_time"): _pdo("inhibit_time: 400", inhibit_time=400),
    (Where.TPDO, "inhibit_ms"): _pdo("inhibit_ms: 40.1", inhibit_time=401),
    (Where.TPDO, "event_timer"): _pdo("event_timer: 50", event_timer=50),
    (Where.TPDO, "sync_start"): _pdo("sync_start: 3", sync_start_value=3),
    (Where.TPDO, "mapping"): _pdo("mapping: [statusword, 6C01:01/16]",
                                  mapping=(FileWord("statusword"), FileWord("6C01:01/16"))),
    (Where.TPDO, "event_deadline"): _left_alone("event_deadline: 5", "defaults: {tpdo: {1"),
    (Where.RPDO, "enabled"): _pdo("enabled: true", RPDO1, enabled=True),
    (Where.RPDO, "cob_id"): _pdo("cob_id: 0x40000205", RPDO1, cob_id=0x205, rtr_allowed=False),
    (Where.RPDO, "rtr_allowed"): _pdo("rtr_allowed: false", RPDO1, rtr_allowed=False),
    (Where.RPDO, "transmission"): _pdo("transmission: 255", RPDO1, transmission_type=255),
    (Where.RPDO, "event_deadline"): _pdo("event_deadline: 100", RPDO1, event_timer=100),
    (Where.RPDO, "mapping"): _pdo("mapping: []", RPDO1, mapping=()),
    **{
        (Where.RPDO, name): _left_alone(f"{name}: 5", "defaults: {rpdo: {1")
        for name in ("inhibit_time", "event_timer", "sync_start")
    },
    (Where.ENTRY, "index"): _pdo("mapping: [{index: 24641}]", mapping=(FileWord("6041:00"),)),
    (Where.ENTRY, "sub_index"): _pdo("mapping: [{index: 0x6C01, sub_index: 10}]", mapping=(FileWord("6C01:0A"),)),
    (Where.ENTRY, "bits"): _pdo("mapping: [{index: 5, bits: 8}]", mapping=(FileWord("0005:00/8"),)),
    (Where.SDO, "index"): _value("index: 0x6081, value: -5", "6081:00", "-5"),
    (Where.SDO, "sub_index"): _value("index: 0x60C2, sub_index: 1, value: 1.5", "60C2:01", "1.5"),
    (Where.SDO, "object"): _value("object: profile_velocity, value: 0x3E8", "profile_velocity", "0x3E8"),
    (Where.SDO, "value"): _value("object: 6081, value: true", "6081:00", "1"),
    (Where.LINK, "from"): _file(
        f"{_TWO}links: [{{from: 2:tpdo1, to: b:rpdo1}}]", lambda config: config.links, (LinkConfig(_FROM_A, (_TO_B,)),)
    ),
    (Where.LINK, "to"): _file(
        f"{_TWO}links: [{{from: a:tpdo1, to: [c:rpdo2]}}]", lambda config: config.links,
        (LinkConfig(_FROM_A, (_TO_C,)),),
    ),
    (Where.LINK, "heartbeat"): _file(
        f"{_TWO}links: [{{from: a:tpdo1, to: b:rpdo1, heartbeat: 100}}]", lambda config: config.links,
        (LinkConfig(_FROM_A, (_TO_B,), 100),),
    ),
}  # fmt: skip
