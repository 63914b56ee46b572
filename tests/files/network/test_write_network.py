"""What is written is read again as it was, and fits the schema."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn

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
from dvtcli.domain.pdo import Direction, Pdo
from dvtcli.files.network.network_keys import OF, Where
from dvtcli.files.network.read_network import read_network
from dvtcli.files.network.write_network import write_network

TEXT = st.text(st.characters(blacklist_categories=["Cs"]), min_size=1, max_size=12).filter(lambda text: text.strip())
NAMES = (TEXT | st.sampled_from(["true", "null", "no", "<<", "master", "~", "0x5", "a b"])).filter(
    lambda name: not name.isdecimal() and ":" not in name
)
OBJECTS = st.sampled_from(["6041:00", "6C01:0A", "60E1:00", "statusword", "Analogue input.Channel 1", "a#b", "yes"])
ENTRIES = OBJECTS | st.sampled_from(["6041:00/16", "dummy/8", "statusword/16"])
U8, U16, U32 = st.integers(0, 0xFF), st.integers(0, 0xFFFF), st.integers(0, 0xFFFF_FFFF)


@st.composite
def pdo_wishes(draw: DrawFn, pdo: Pdo) -> PartialPdoConfig:
    extended = draw(st.booleans())
    cob_id = draw(st.none() | st.just("auto") | st.integers(0, 0x1FFF_FFFF if extended else 0x7FF))
    words = draw(st.none() | st.lists(ENTRIES, max_size=4))
    tpdo = pdo.is_tpdo
    return PartialPdoConfig(
        pdo, draw(st.none() | st.booleans()), cob_id, extended and isinstance(cob_id, int),
        draw(st.none() | st.booleans()), draw(st.none() | U8), draw(st.none() | U16) if tpdo else None,
        draw(st.none() | U16), draw(st.none() | U8) if tpdo else None,
        None if words is None else tuple(map(FileWord, words)),
    )  # fmt: skip


def objects(draw: DrawFn) -> tuple[ObjectConfig, ...]:
    made = [
        ObjectConfig(key.name, *key.object[:2], draw(st.binary(min_size=key.object[2], max_size=key.object[2])))
        for key in OF[Where.NODE].values()
        if key.object is not None and draw(st.booleans())
    ]
    for sub_index in draw(st.sets(st.integers(1, 254), max_size=2)):
        made.append(ObjectConfig("error_behavior", 0x1029, sub_index, draw(st.binary(min_size=1, max_size=1))))  # noqa: PERF401
    return tuple(sorted(made, key=lambda one: (one.index, one.sub_index)))


@st.composite
def node_wishes(draw: DrawFn, node_id: int, name: str) -> NodeConfig:
    pdos = [Pdo(direction, number) for direction in (Direction.TPDO, Direction.RPDO)
            for number in sorted(draw(st.sets(st.integers(1, 512), max_size=2)))]  # fmt: skip
    values = {word: draw(st.integers(-5, 1 << 40).map(str) | TEXT | st.sampled_from(["010", "true", "1e5"]))
              for word in draw(st.sets(OBJECTS, max_size=2))}  # fmt: skip
    watches = {producer: draw(U16) for producer in sorted(draw(st.sets(st.integers(1, 127), max_size=2)))}
    store = draw(st.none() | st.sampled_from([False, "all", "communication", "4"]))
    pins = sorted(draw(st.sets(st.tuples(st.sampled_from(["motor", "digital-in"]), st.integers(1, 254)), max_size=3)))
    return NodeConfig(
        name, node_id,
        ExpectedIdentity(*(draw(st.none() | U32) for _ in range(4))),
        draw(st.none() | TEXT), draw(st.none() | TEXT.map(FileWord)),
        tuple(draw(pdo_wishes(pdo)) for pdo in pdos), objects(draw),
        tuple(ValueConfig(FileWord(word), FileWord(value)) for word, value in values.items()),
        tuple(HeartbeatWatch(producer, time_ms) for producer, time_ms in watches.items()),
        tuple(PinConfig(group, pin, draw(st.none() | OBJECTS.map(FileWord))) for group, pin in pins),
        store, draw(st.none() | st.booleans()), draw(st.sampled_from([None, False, *[True] * (store == "all")])),
        physical=draw(st.sampled_from([(), (("2000-2001:01", '"1/16 V"'), ("6041", '{"values": {"0": "off"}}'))])),
    )  # fmt: skip


@st.composite
def networks(draw: DrawFn) -> NetworkConfig:
    ids = sorted(draw(st.sets(st.integers(1, 120), min_size=1, max_size=3)))
    names = draw(st.lists(NAMES, min_size=len(ids), max_size=len(ids), unique=True))
    nodes = tuple(draw(node_wishes(*pair)) for pair in zip(ids, names, strict=True))
    received = sorted(draw(st.sets(st.tuples(st.sampled_from(ids), st.integers(1, 512)), max_size=2)))
    consumers = tuple(Endpoint(node_id, Pdo(Direction.RPDO, number)) for node_id, number in received)
    producer = Endpoint(draw(st.sampled_from(ids)), Pdo(Direction.TPDO, draw(st.integers(1, 512))))
    heartbeat = draw(st.none() | st.just(False) | st.integers(1, 0xFFFF))
    master = draw(
        st.none()
        | st.builds(
            MasterRole,
            st.none() | st.integers(121, 127),
            st.none() | U32,
            st.none() | U16,
            st.none() | st.integers(1, 1000).map(lambda kbit_per_s: 1000 * kbit_per_s),
        )
    )
    links = (LinkConfig(producer, consumers, heartbeat),) if consumers else ()
    return NetworkConfig(nodes, links, master, draw(st.none() | st.sampled_from([1.0, 2.5, 100.0])))


@given(networks(), TEXT)
def test_what_is_written_is_read_again(config: NetworkConfig, title: str) -> None:
    remarks = {(node.node_id, "6041:00"): title for node in config.nodes}
    text = write_network(config, title, remarks)
    assert read_network(text, "net.yaml") == config, text
    assert write_network(read_network(text, "net.yaml"), title, remarks) == text
