"""What a CANopen manager downloads to its nodes as a network file, which planned for that manager changes nothing."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import dvtcli
from dvtcli.domain.network.concise_dcf import ConciseEntry, concise_bytes
from dvtcli.domain.network.network_config import ExpectedIdentity, FileWord
from dvtcli.domain.pdo import Direction, Pdo
from dvtcli.errors import UsageError
from dvtcli.files.network.read_network import read_network_file
from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy
from tests.small_eds import U8, U32, Eds, communication, plain, var

VENDOR, PRODUCT = 0x1234, 0x55
EXAMPLES = Path(__file__).parents[3] / "examples"
#: what keys, single objects, watches and links make of two nodes, and PDOs that go off
FILE = """io:
  node_id: 4
  heartbeat_producer: 250
  error_behavior: {1: 2}
  sync_period: 20000
  sdo:
    - {object: "2004:00", value: -5}
    - {object: "2003:00", value: 1.5}
    - {object: "2002:00", value: belt}
    - {object: "2001:00", value: 0x0102030405060708}
  heartbeat_consumer: {drive: 900}
  tpdo:
    1: {event_timer: 50, inhibit_ms: 10.0, mapping: [6000:01, 6000:02]}
    2: {enabled: false, mapping: []}
  rpdo:
    1: {cob_id: 0x185, transmission: 1, enabled: true}
    2: {mapping: [6200:01, 6200:02]}
drive:
  node_id: 5
  heartbeat_producer: 300
  sdo:
    - {object: "1016:02", value: 0x000A0064}
    - {object: "1014:00", value: 0x95}
  tpdo:
    1: {cob_id: 0x20000305, rtr_allowed: false, enabled: true, sync_start: 3, transmission: 4}
    2: {enabled: true, mapping: [6000:03, 6000:04]}
links:
  - {from: "drive:tpdo2", to: ["io:rpdo2"]}
"""


def eds(name: str) -> Eds:
    """A device with services and settings of several types."""
    made = plain()
    made.info = {"ProductName": name, "VendorNumber": VENDOR, "ProductNumber": PRODUCT}
    made.record(0x1800, "TPDO 1", communication("$NODEID+0x180", sub6=var("SYNC start value", U8, 0)))
    made.variable(0x1006, var("SYNC period", U32, 0))
    made.variable(0x1014, var("COB-ID EMCY", U32, "$NODEID+0x80"))
    made.record(0x1016, "Consumer heartbeat time", {sub: var(f"Entry {sub}", U32, 0) for sub in (1, 2)})
    made.record(0x1029, "Error behaviour", {1: var("Communication error", U8, 0)})
    for index, kind in ((0x2001, 0x1B), (0x2002, 0x9), (0x2003, 0x8), (0x2004, 0x3), (0x2005, 0xA)):
        made.variable(index, var(f"Setting {index:X}", kind, "" if kind in (0x9, 0xA) else 0))
    return made


@pytest.fixture(autouse=True)
def _ground(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    manager, subs = plain(), range(1, 13)
    manager.record(0x1F22, "Concise DCF", {sub: var(f"Node {sub}", 0xF) for sub in subs})
    for index in (0x1F26, 0x1F27, 0x1F85, 0x1F86):
        manager.record(index, f"Expected {index:X}", {sub: var(f"Node {sub}", U32, 0) for sub in subs})
    Path("manager.eds").write_text(manager.text(), "utf-8")
    Path("node.eds").write_text(eds("Conveyor").text(), "utf-8")


def described(text: str, families: dict[int, str]) -> str:
    """A network file's *text* where `dcf:` names the family of each node: none of them is there to be asked."""
    return re.sub(
        r"(?m)^( +)node_id: (\d+)\n", lambda found: f"{found[0]}{found[1]}dcf: {families[int(found[2])]}\n", text
    )


def expect(bench: Bench, node_id: int, vendor: int, product: int) -> None:
    """Let the manager expect a node to be of *vendor* and *product*."""
    for index, number in ((0x1F85, vendor), (0x1F86, product)):
        bench.session.node(12).sdo.download(index, node_id, number.to_bytes(4, "little"))


@heavy
@pytest.mark.parametrize(
    ("file", "families"),
    [
        ("", {4: "node.eds", 5: "node.eds"}),
        ("traction.yaml", {1: "gen4", 5: "generic", 9: "generic"}),
        ("line.yaml", {1: "gen4", 5: "generic"}),
        ("press.yaml", {1: "gen4", 5: "generic"}),
    ],
)
def test_the_file_says_to_the_manager_what_it_holds(file: str, families: dict[int, str]) -> None:
    text = (EXAMPLES / file).read_text("utf-8") if file else FILE
    Path("net.yaml").write_text(described(text, families), "utf-8")
    with Bench(("manager.eds@12",), {"yes": True}) as bench:
        assert bench.run("apply net.yaml --to-manager 12").code == 0
        for node_id in () if file else families:
            expect(bench, node_id, VENDOR, PRODUCT)
        assert bench.run("eds add node.eds").code == 0
        ran = bench.run("import again.yaml --from-manager 12 --json")
        assert (ran.code, ran.document["errors"]) == (0, 0), ran
        assert all(not row["left_out"] for row in ran.document["nodes"])
        if file:  # else the manager says who its nodes are, and the library has their EDS
            imported = Path("again.yaml").read_text("utf-8")
            Path("again.yaml").write_text(described(imported, families), "utf-8")
        again = bench.run("plan again.yaml --to-manager 12 --json")
        assert (again.code, again.document["nodes"][0]["objects"]) == (0, []), again


def downloads(bench: Bench, node_id: int, *entries: tuple[int, int, bytes]) -> None:
    """Let the manager download *entries* to a node."""
    data = concise_bytes([ConciseEntry(*one) for one in entries])
    bench.session.node(12).sdo.download(0x1F22, node_id, data)


def test_what_a_file_cannot_say_is_named_and_what_is_not_downloaded_is_absent() -> None:
    with Bench(("manager.eds@12",), {"yes": True}) as bench:
        downloads(
            bench, 3,
            (0x1800, 1, bytes.fromhex("83010080")), (0x1800, 5, b"\x32\0"), (0x1800, 4, b"\0"), (0x1400, 3, b"\1\0"),
            (0x1A00, 1, bytes.fromhex("08010060")), (0x1A01, 1, bytes.fromhex("08010060")), (0x1A01, 0, b"\1"),
            (0x1602, 0, b"\1"), (0x1602, 1, bytes.fromhex("00010062")), (0x1602, 2, bytes(4)),
            (0x2001, 0, b"\1\2\3"), (0x1010, 1, b"save"), (0x1017, 0, b"\xe8"), (0x2000, 7, b"\xff\xff"),
        )  # fmt: skip
        ran = bench.run("import net.yaml --from-manager 12 --json")
        assert ran.code == 0, ran
        (row,) = ran.document["nodes"]
        assert row["left_out"] == [
            "1010:01",
            "1400:03",
            "1602:00",
            "1602:01",
            "1602:02",
            "1800:04",
            "1A00:01",
            "2001:00",
        ]
        said = " ".join(ran.document["notes"])
        for words in ("2001:00 (3 bytes, and no EDS defines its type)", "1010:01 (a command)", "no EDS"):
            assert words in said
    (node,) = read_network_file(Path("net.yaml")).nodes
    first, second = node.pdos
    assert (first.pdo, first.enabled, first.event_timer) == (Pdo(Direction.TPDO, 1), False, 50)
    assert (first.transmission_type, first.inhibit_time, first.mapping) == (None, None, None)
    assert (second.enabled, second.cob_id, second.mapping) == (None, None, (FileWord("6000:01/8"),))
    assert [(one.object.text, one.value.text) for one in node.values] == [("1017:00", "0xE8"), ("2000:07", "0xFFFF")]
    assert node.identity == ExpectedIdentity()


def test_what_is_downloaded_twice_is_named_and_the_file_has_the_last() -> None:
    """To unlock, or to select, an object is downloaded more than once; a PDO is off before it is on."""
    with Bench(("manager.eds@12",), {"yes": True}) as bench:
        downloads(
            bench, 3,
            (0x2000, 1, b"\1\0"), (0x2000, 2, b"\5\0"), (0x2000, 1, b"\2\0"), (0x2000, 2, b"\5\0"),
            (0x2000, 3, b"\7\0"), (0x1800, 1, bytes.fromhex("83010080")), (0x1A00, 0, b"\0"),
            (0x1A00, 1, bytes.fromhex("08010060")), (0x1A00, 0, b"\1"), (0x1800, 1, bytes.fromhex("83010000")),
            (0x1020, 1, bytes(4)), (0x1020, 1, b"\1\0\0\0"),
        )  # fmt: skip
        ran = bench.run("import net.yaml --from-manager 12 --json")
        assert (ran.code, ran.document["nodes"][0]["left_out"]) == (0, ["2000:01", "2000:02"]), ran
        assert "2000:01 (downloaded 2 times, the file has the last)" in " ".join(ran.document["notes"])
    (node,) = read_network_file(Path("net.yaml")).nodes
    assert [(one.object.text, one.value.text) for one in node.values] == [
        ("2000:01", "0x0002"), ("2000:02", "0x0005"), ("2000:03", "0x0007"),
    ]  # fmt: skip
    assert [(one.enabled, one.cob_id, one.mapping) for one in node.pdos] == [(True, 0x183, (FileWord("6000:01/8"),))]


def test_a_pdo_that_is_on_with_can_id_0_is_named() -> None:
    """No key says it: that PDO would be enabled with whatever CAN-ID it has. One that is off with 0 is only off."""
    with Bench(("manager.eds@12",), {"yes": True}) as bench:
        downloads(bench, 3, (0x1800, 1, bytes(4)), (0x1800, 5, b"\x32\0"), (0x1801, 1, bytes.fromhex("00000080")))
        ran = bench.run("import net.yaml --from-manager 12 --json")
        assert (ran.code, ran.document["nodes"][0]["left_out"]) == (0, ["1800:01"]), ran
        assert "1800:01 (0x00000000: a PDO that is on has no CAN-ID 0)" in " ".join(ran.document["notes"])
    (node,) = read_network_file(Path("net.yaml")).nodes
    said = [(one.enabled, one.cob_id, one.event_timer) for one in node.pdos]
    assert said == [(None, None, 50), (False, None, None)]


def test_a_stream_that_is_broken_is_said_and_the_others_are_imported() -> None:
    with Bench(("manager.eds@12",), {"yes": True}) as bench:
        downloads(bench, 3, (0x1017, 0, b"\xe8\3"))
        bench.session.node(12).sdo.download(0x1F22, 4, b"\2\0\0\0\x17\x10")
        ran = bench.run("import net.yaml --from-manager 12")
        assert ran.code == 0
        assert "note: node 4 is left out: 0x1F22:04 is not a concise DCF: it ends in entry 1 of 2" in ran.stdout
    (node,) = read_network_file(Path("net.yaml")).nodes
    assert [(one.key, one.data) for one in node.objects] == [("heartbeat_producer", b"\xe8\3")]


def test_a_node_is_named_by_its_eds_where_it_answers_or_the_manager_expects_it() -> None:
    """Node 3 is there, node 1 is not: the manager expects the vendor and product of a gen4."""
    with Bench(("manager.eds@12", "generic@3"), {"yes": True}) as bench:
        expect(bench, 1, 0x1E, 0x0705302D)
        mapped = ((0x1A00, 0, b"\0"), (0x1A00, 1, bytes.fromhex("10004160")), (0x1A00, 0, b"\1"))
        for node_id in (1, 3):
            downloads(bench, node_id, *mapped)
        assert bench.run("import net.yaml --from-manager 12 -q").code == 0
    gen4, generic = read_network_file(Path("net.yaml")).nodes
    assert (gen4.dcf, generic.dcf) == (FileWord("gen4"), FileWord("generic"))
    assert (gen4.identity.vendor, gen4.identity.product) == (0x1E, 0x0705302D)
    assert gen4.pdos[0].mapping == generic.pdos[0].mapping == (FileWord("statusword"),)


def test_a_stamp_stays_one_and_stands_for_the_file() -> None:
    with Bench(("manager.eds@12",), {"yes": True}) as bench:
        downloads(bench, 3, (0x1017, 0, b"\xe8\3"), (0x1020, 1, b"\1\0\0\0"), (0x1020, 2, b"\2\0\0\0"))
        ran = bench.run("import net.yaml --from-manager 12")
        assert "its 0x1020 becomes `stamp: true`, which writes another date and time" in ran.stdout
    (node,) = read_network_file(Path("net.yaml")).nodes
    assert (node.store, node.stamp, node.values) == ("all", True, ())


def test_who_is_no_manager_or_downloads_nothing_is_refused() -> None:
    with Bench(("generic@3", "manager.eds@12"), {"yes": True}) as bench:
        ran = bench.run("import net.yaml --from-manager 3")
        ran.failed(2, "does not return its 0x1F22:00")
        ran = bench.run("import net.yaml --from-manager 12")
        ran.failed(2, "downloads no values to any node")
        assert bench.run("import net.yaml . --from-manager 12").code == 2
    assert not Path("net.yaml").exists()


def test_a_program_imports_what_a_manager_downloads() -> None:
    with dvtcli.simulate("manager.eds@12") as bus:
        data = concise_bytes([ConciseEntry(0x1017, 0, b"\xe8\3")])
        bus.node(12).canopen().sdo.download(0x1F22, 3, data)
        (note,) = bus.import_network("net.yaml", from_manager=12)
        assert "node 3: no EDS" in note
        for wrong in (0, 128, "12"):
            with pytest.raises(UsageError):
                bus.import_network("net.yaml", from_manager=wrong, yes=True)  # type: ignore[arg-type]
    (node,) = read_network_file(Path("net.yaml")).nodes
    assert node.node_id == 3


@pytest.mark.parametrize(
    ("vendor", "product", "others"), [(0, 0, False), (0x1E, 0, False), (0, 1, True), (0x1F, 0, True)]
)
def test_a_manager_checks_only_what_it_expects(vendor: int, product: int, others: bool) -> None:
    """0x1F85 or 0x1F86 that is 0 is any vendor, any product (CiA 302-2)."""
    with Bench(("manager.eds@12", "gen4@1"), {"yes": True}) as bench:
        downloads(bench, 1, (0x1017, 0, bytes([100, 0])))
        expect(bench, 1, vendor, product)
        ran = bench.run("import again.yaml --from-manager 12")
        assert ("is another device than node 12 expects" in ran.stdout) == others, ran
        assert ("dcf: gen4" in Path("again.yaml").read_text("utf-8").replace('"', "")) != others
