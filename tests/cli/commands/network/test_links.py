"""`link`, `unlink` and links of a network file, on simulated nodes of three families."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import dvtcli
from dvtcli.errors import UsageError
from tests.cli.commands.bench import Bench, beside
from tests.cli.commands.bus import device
from tests.harness.sample import heavy
from tests.house.source import PACKAGE

#: gen4 can skip and watch a heartbeat, tmcm neither.
NODES = ("gen4@1", "tmcm@5", "generic@6")


@pytest.fixture
def bench() -> Iterator[Bench]:
    with Bench(NODES, {"yes": True}) as made:
        yield made


def pdos(bench: Bench, node_id: int) -> dict[str, Any]:
    """Every PDO of a node, by name."""
    assert bench.run(f"node {node_id}").code == 0
    return {one["pdo"]: one for one in bench.run("pdo --all --json").document["pdos"]}


def held(bench: Bench) -> list[Any]:
    """Every PDO of all nodes, and what they say of heartbeats."""
    rows = [pdos(bench, node_id) for node_id in (1, 5, 6)]
    words = ("1:1017", "6:1017", "6:1016:01")
    return [*rows, *(value(bench, word) for word in words)]


def value(bench: Bench, word: str) -> int:
    node_id, _, place = word.partition(":")
    assert bench.run(f"node {node_id}").code == 0
    return int(bench.run(f"read {place} --json").document["value"])


def mapped(pdo: dict[str, Any]) -> list[str]:
    return [f"{one['object']}/{one['bits']}" for one in pdo["mapping"]]


@heavy
def test_consumers_hear_the_producer_at_its_places_and_watch_it(bench: Bench) -> None:
    assert bench.run("map 1:tpdo1 6041 606C --cob-id 0x201").code == 0
    assert bench.run("map 5:rpdo2 6040 60FF --off").code == 0
    assert bench.run("map 6:rpdo1 60FF --off").code == 0
    before = held(bench)
    ran = bench.run("link 1:tpdo1 5:rpdo2 6:rpdo1 --json")
    assert ran.code == 0, ran
    assert ran.document["schema"] == "dvtcli.apply/1"
    said = [(node["node"], one["rule"], one["text"]) for node in ran.document["nodes"] for one in node["findings"]]
    assert (5, "link-unwatched", "node 5 does not monitor node 1: it has no 0x1016") in said
    one, two, three = pdos(bench, 1)["tpdo1"], pdos(bench, 5)["rpdo2"], pdos(bench, 6)["rpdo1"]
    assert [pdo["cob_id"] for pdo in (one, two, three)] == [0x201] * 3
    assert all(pdo["enabled"] for pdo in (one, two, three))
    assert (mapped(two), mapped(three)) == (["6040:00/16", "60FF:00/32"], ["0003:00/16", "60FF:00/32"])
    assert value(bench, "6:1016:01") == 1 << 16 | 3 * value(bench, "1:1017")
    again = bench.run("link 1:tpdo1 5:rpdo2 6:rpdo1 --json").document
    assert (again["changed"], again["writes"]) == (False, 0)
    assert bench.run("undo --all").code == 0
    assert bench.run("map 1:tpdo1 6041 606C --cob-id 0x201").code == 0
    assert bench.run("map 5:rpdo2 6040 60FF --off").code == 0
    assert bench.run("map 6:rpdo1 60FF --off").code == 0
    assert held(bench) == before


def test_consumers_go_on_before_the_producer(bench: Bench) -> None:
    assert bench.run("map 1:tpdo1 6041 606C --off").code == 0
    assert bench.run("map 5:rpdo2 6040 60FF --off").code == 0
    enabled: list[tuple[int, int]] = []

    def note(frame: Any, sent: bool) -> None:
        index = int.from_bytes(frame.data[1:3], "little")
        is_cob_id = sent and 0x600 < frame.can_id < 0x680 and frame.data[0] == 0x23 and frame.data[3] == 1
        if is_cob_id and index in (0x1401, 0x1800) and not frame.data[7] & 0x80:
            enabled.append((frame.can_id - 0x600, index))

    bench.session.open_network().bus.tap(note)
    assert bench.run("link 1:tpdo1 5:rpdo2").code == 0
    assert enabled == [(5, 0x1401), (1, 0x1800)]


@heavy
@pytest.mark.parametrize("place", ["1:refuse@1", "5:refuse@1", "6:refuse@1", "6:refuse@2"])
def test_a_fault_on_one_node_brings_all_of_them_back(place: str) -> None:
    with Bench(NODES, {"yes": True, "fault": (f"{place}=0x08000021",)}) as bench:
        before = held(bench)
        ran = bench.run("link 1:tpdo1 5:rpdo1 6:rpdo1 --heartbeat 300 --json")
        assert (ran.code, ran.documents[-1]["state"]) in ((1, "rolled_back"), (1, "unchanged")), ran
        assert held(bench) == before


@heavy
def test_a_dry_run_changes_nothing(bench: Bench) -> None:
    before = held(bench)
    assert bench.run("map 6:rpdo1 60FF --off").code == 0
    ran = bench.run("link 1:tpdo2 6:rpdo1 --dry-run")
    assert ran.code == 0, ran
    assert "Nothing was written." in ran.stdout
    assert bench.run("undo").code == 0
    assert held(bench) == before


def test_a_can_id_that_another_node_sends_is_not_taken(bench: Bench) -> None:
    assert bench.run("set 1:tpdo2 --cob-id 0x2A0 --off").code == 0
    assert bench.run("set 5:tpdo1 --cob-id 0x2A0 --force").code == 0
    assert bench.run("map 6:rpdo1 60FF --off").code == 0
    assert bench.run("link 1:tpdo2 6:rpdo1").code == 0
    assert pdos(bench, 1)["tpdo2"]["cob_id"] == pdos(bench, 6)["rpdo1"]["cob_id"] == 0x281


def test_the_heartbeat_is_set_and_watched_or_left_alone(bench: Bench) -> None:
    assert bench.run("map 6:rpdo1 60FF --off").code == 0
    assert bench.run("link 1:tpdo2 6:rpdo1 --no-heartbeat").code == 0
    assert value(bench, "6:1016:01") & 0xFFFF == 0
    assert bench.run("link 1:tpdo2 6:rpdo1 --heartbeat 250").code == 0
    assert (value(bench, "1:1017"), value(bench, "6:1016:01")) == (250, 1 << 16 | 750)
    assert bench.run("link 1:tpdo2 6:rpdo1 --heartbeat 250 --no-heartbeat").code == 2
    assert bench.run("unlink 1:tpdo2 6:rpdo1").code == 0
    assert value(bench, "6:1016:01") == 0
    assert not pdos(bench, 6)["rpdo1"]["enabled"]
    assert pdos(bench, 1)["tpdo2"]["enabled"]


def test_a_producer_without_heartbeat_is_said(bench: Bench) -> None:
    assert bench.run("map 6:rpdo1 60FF --off").code == 0
    assert bench.run("node 1").code == 0
    assert bench.run("write 1017 0").code == 0
    asked = bench.run("link 1:tpdo2 6:rpdo1 --dry-run --json").document
    said = [one for node in asked["nodes"] for one in node["findings"] if one["rule"] == "link-silent"]
    assert [(one["severity"], one["place"]) for one in said] == [("note", "node 1")]
    ran = bench.run("link 1:tpdo2 6:rpdo1")
    assert ran.code == 0
    assert "node 1 sends no heartbeat" in ran.stderr
    assert value(bench, "6:1016:01") & 0xFFFF == 0
    told = bench.run("link 1:tpdo2 6:rpdo1 --heartbeat 250 --json")
    assert told.code == 0
    assert "link-silent" not in told.stdout
    assert value(bench, "6:1016:01") & 0xFFFF


def test_nodes_that_run_are_asked_for() -> None:
    with Bench(("gen4@1", "generic@6")) as bench:
        assert bench.run("map 6:rpdo1 60FF --off").code == 0
        assert bench.run("nmt start 6").code == 0
        ran = bench.run("link 1:tpdo2 6:rpdo1 --json")
        assert (ran.code, ran.documents[-1]["state"]) == (6, "unchanged")
        assert not pdos(bench, 6)["rpdo1"]["enabled"]
        assert bench.run("nmt preop 6").code == 0
        assert bench.run("link 1:tpdo2 6:rpdo1").code == 0


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("link 1:tpdo1", 2),
        ("link 5:rpdo2 1:tpdo1", 2),
        ("link 1:tpdo1 5:tpdo1", 2),
        ("link 1:tpdo1 5:rpdo2 5:rpdo2", 2),
        ("link 1:tpdo1 5:rpdo99", 1),
        ("link 1:tpdo1 1:rpdo2", 1),
        ("link 1:tpdo1 5:rpdo1", 0),
        ("link 1:tpdo1 5:rpdo2", 1),
        ("link 1:tpdo1 9:rpdo1", 5),
        ("unlink 1:tpdo1 5:rpdo1", 2),
        ("unlink 5:rpdo1 5:rpdo1", 2),
    ],
)
def test_what_is_no_link(bench: Bench, line: str, code: int) -> None:
    before = held(bench)
    ran = bench.run(f"{line} --json")
    assert ran.code == code, ran
    if code:
        assert [one["state"] for one in ran.documents] in ([], ["unchanged"])  # click's own errors are text
        assert held(bench) == before


def test_an_rpdo_that_maps_nothing_is_said_with_what_comes_first(bench: Bench) -> None:
    assert bench.run("map 1:tpdo1 6041 606C").code == 0
    assert bench.run("clear 5:rpdo2").code == 0
    said = bench.run("link 1:tpdo1 5:rpdo2").stderr
    assert "5:rpdo2 maps nothing" in said
    first = r"first `dvtcli .*\bmap 5:rpdo2 OBJECT.* --off`, with what should receive (.*)"
    found = re.search(first, said)
    assert found, said
    assert found[1] == "6041:00 (16 bits), 606C:00 (32 bits) of 1:tpdo1; then link"


def test_a_link_that_stands_is_said_without_a_file(bench: Bench) -> None:
    assert bench.run("map 5:rpdo1 6040 --off").code == 0
    assert bench.run("map 1:tpdo1 6041").code == 0
    assert bench.run("link 1:tpdo1 5:rpdo1").code == 0
    again = bench.run("link 1:tpdo1 5:rpdo1")
    assert "Every node has what `link 1:tpdo1 5:rpdo1` makes already; nothing was written." in again.stdout
    assert "the file" not in again.stdout


FILE = """
nodes:
  drive: {node_id: 1, tpdo: {1: {cob_id: 0x201, mapping: [statusword, velocity_actual_value]}}}
  motor: {node_id: 5, rpdo: {2: {mapping: [controlword, target_velocity]}}}
  other: {node_id: 6, rpdo: {1: {mapping: [60FF:00]}}}
links:
  - {from: drive:tpdo1, to: [motor:rpdo2, other:rpdo1], heartbeat: 400}
"""


@heavy
def test_links_of_a_file_are_planned_and_applied(bench: Bench, tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    file.write_text(FILE)
    assert bench.run(f"diff {file}").code == 3
    assert bench.run(f"apply {file}").code == 0
    assert bench.run(f"diff {file}").code == 0
    assert mapped(pdos(bench, 6)["rpdo1"]) == ["0003:00/16", "60FF:00/32"]
    assert (value(bench, "1:1017"), value(bench, "6:1016:01")) == (400, 1 << 16 | 1200)
    file.write_text(FILE.replace("{2: {mapping", "{2: {cob_id: 0x301, mapping"))
    ran = bench.run(f"plan {file} --json")
    assert (ran.code, ran.documents[-1]["findings"][0]["rule"]) == (1, "link-can-id")


@pytest.mark.parametrize("consumer_first", [True, False])
def test_a_can_id_with_two_producers_is_the_only_error_of_their_link(
    bench: Bench, tmp_path: Path, *, consumer_first: bool
) -> None:
    """The link keeps the CAN-ID that the file gives its RPDO: another CAN-ID would be an error that follows."""
    file = tmp_path / "net.yaml"
    nodes = (
        "  motor: {node_id: 5, rpdo: {2: {cob_id: 0x181, mapping: [controlword]}}}\n",
        "  drive: {node_id: 1, tpdo: {1: {mapping: [statusword]}}}\n",
        "  other: {node_id: 6, tpdo: {1: {cob_id: 0x181, mapping: [statusword]}}}\n",
    )
    text = "".join(nodes if consumer_first else reversed(nodes))
    file.write_text(f"nodes:\n{text}links: [{{from: drive:tpdo1, to: motor:rpdo2, heartbeat: false}}]\n")
    for line in ("plan", "diff", "apply"):
        ran = bench.run(f"{line} {file} --json")
        found = [(one["rule"], one["text"]) for one in ran.document["findings"]]
        assert ran.code == 1
        assert found == [("can-id-clash", "CAN-ID 0x181 is already sent by TPDO1 of node 1")]
        assert ran.document["text"] == "node 6: CAN-ID 0x181 is already sent by TPDO1 of node 1"


def test_a_link_of_a_synchronous_tpdo_warns_without_a_sync_producer(bench: Bench) -> None:
    assert bench.run("map 1:tpdo1 6041 606C --cob-id 0x201 --sync 1").code == 0
    assert bench.run("map 6:rpdo1 60FF --off").code == 0
    ran = bench.run("link 1:tpdo1 6:rpdo1 --dry-run")
    said = "TPDO1 is synchronous (type 1), and no known node produces SYNC, for which it waits"
    assert (ran.code, said in ran.stderr) == (0, True), ran
    nodes = bench.run("link 1:tpdo1 6:rpdo1 --dry-run --json").document["nodes"]
    assert "link-no-sync" in {found["rule"] for node in nodes for found in node["findings"]}
    for line in ("write 6:1006 20000", "write 6:1005 0x40000080"):
        assert bench.run(line).code == 0
    assert "SYNC" not in bench.run("link 1:tpdo1 6:rpdo1 --dry-run").stderr
    for line in ("write 6:1005 0x80", "set 1:tpdo1 --event"):
        assert bench.run(line).code == 0
    assert "SYNC" not in bench.run("link 1:tpdo1 6:rpdo1").stderr


def test_a_node_that_does_not_answer_may_produce_sync(tmp_path: Path) -> None:
    """It is not claimed that no node does."""
    bus = beside([device("gen4", 1), device("gen4", 6)])
    with Bench((), {"yes": True, "node": 9, "journal": str(tmp_path)}, bus) as bench:
        assert bench.run("map 1:tpdo1 6041 606C --cob-id 0x201 --sync 1").code == 0
        assert bench.run("map 6:rpdo1 60FF --off").code == 0
        ran = bench.run("link 1:tpdo1 6:rpdo1 --dry-run")
        assert (ran.code, "produces SYNC" in ran.stderr) == (0, False), ran.stderr


def test_programs_link_and_unlink() -> None:
    with dvtcli.simulate("gen4@1", "tmcm@5") as bus:
        bus.node(5).map("rpdo2", "60FF", "6040", enabled=False)
        bus.node(1).map("tpdo1", "606C", "6041")
        done = bus.link("1:tpdo1", "5:rpdo2", heartbeat=False)
        assert done
        assert [one.node_id for one in done.plan.nodes if len(one.plan)] == [5]
        assert bus.unlink("1:tpdo1", "5:rpdo2")
        for wrong in (("tpdo1", "5:rpdo2"), ("1:tpdo1",), ("1:tpdo1", "5:xpdo2"), ("200:tpdo1", "5:rpdo2")):
            with pytest.raises(UsageError):
                bus.link(*wrong)


def test_the_file_says_after_how_many_heartbeats_one_is_late(bench: Bench, tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    file.write_text("options: {heartbeat_multiplier: 2.5}\n" + FILE)
    assert bench.run(f"apply {file}").code == 0
    assert value(bench, "6:1016:01") == 1 << 16 | 1000


@heavy
def test_who_goes_on_hearing_a_can_id_that_is_given_up_is_named(bench: Bench, tmp_path: Path) -> None:
    assert bench.run("map 1:tpdo1 6041 606C --cob-id 0x2A1").code == 0
    assert bench.run("map 6:rpdo1 60FF --off").code == 0
    assert bench.run("map 6:rpdo2 dummy/16 60FF --cob-id 0x2A1").code == 0
    moves, stays = "cob_id: 0x2A2", "enabled: true"
    file = tmp_path / "net.yaml"
    text = "a: {{node_id: 1, tpdo: {{1: {{{}}}}}}}\n"
    for node_6 in ("", "b: {node_id: 6}\n"):  # known to the session, or in the file
        file.write_text(text.format(moves) + node_6)
        document = bench.run(f"plan {file} --json").document
        found = [one["text"] for one in document["nodes"][0]["findings"] if one["rule"] == "consumer-left"]
        assert found == ["6:rpdo2 still receives 0x2A1, which 1:tpdo1 no longer sends"]
    others = "b: {node_id: 6, rpdo: {2: {cob_id: 0x2A2}}}\n", "c: {node_id: 5, tpdo: {1: {cob_id: 0x2A1}}}\n"
    for text_ in (text.format(stays), *(text.format(moves) + one for one in others)):
        file.write_text(text_)
        assert "still receives" not in bench.run(f"plan {file}").stderr


def test_a_node_without_0x1017_gets_no_heartbeat(tmp_path: Path) -> None:
    eds = tmp_path / "silent.eds"
    text = (PACKAGE / "families" / "generic" / "generic.eds").read_text("latin-1")
    eds.write_text(text.replace("=0x1017\n", "=0x1019\n").replace("\n[1017]\n", "\n[1019]\n"), "latin-1")
    with Bench((f"{eds}@1", "generic@6"), {"yes": True}) as bench:
        ran = bench.run("link 1:tpdo1 6:rpdo1 --heartbeat 100 --json")
        assert (ran.code, [one["rule"] for one in ran.documents[-1]["findings"]]) == (1, ["link-no-heartbeat"])
        assert bench.run("link 1:tpdo1 6:rpdo1").code == 0


def test_objects_that_stay_are_judged_by_the_device_s_file(tmp_path: Path) -> None:
    eds, file = tmp_path / "other.eds", tmp_path / "net.yaml"
    text = (PACKAGE / "families" / "generic" / "generic.eds").read_text("latin-1")
    head, _, behind = text.partition("\n[6040]\n")
    eds.write_text(head + "\n[6040]\n" + behind.replace("AccessType=rww", "AccessType=ro", 1), "latin-1")
    file.write_text(
        "a: {node_id: 1}\nb: {node_id: 6, dcf: other.eds}\nlinks: [{from: a:tpdo1, to: b:rpdo1, heartbeat: false}]\n"
    )
    with Bench(("gen4@1", "generic@6")) as bench:
        assert bench.run(f"plan {file}").code == 1, "6040 is ro in the file: no RPDO takes it"
        findings = bench.run(f"plan {file} --json --force").document["nodes"][1]["findings"]
        (found,) = [one for one in findings if one["rule"] == "link-object"]
        assert "6:rpdo1 maps what it cannot: 6040:00" in found["text"]


GUARDED = """
[100C]
ParameterName=Guard time
ObjectType=0x7
DataType=0x0006
AccessType=rw
DefaultValue=100
PDOMapping=0

[100D]
ParameterName=Life time factor
ObjectType=0x7
DataType=0x0005
AccessType=rw
DefaultValue=3
PDOMapping=0
"""


def test_a_guarded_node_gets_no_heartbeat(tmp_path: Path) -> None:
    eds = tmp_path / "guarded.eds"
    text = (PACKAGE / "families" / "generic" / "generic.eds").read_text("latin-1")
    text = text.replace("SupportedObjects=51\n", "SupportedObjects=53\n52=0x100C\n53=0x100D\n")
    eds.write_text(text.replace("\n[1017]\n", f"{GUARDED}\n[1017]\n"), "latin-1")
    with Bench((f"{eds}@1", "generic@6")) as bench:
        before = value(bench, "1:1017")
        ran = bench.run("link 1:tpdo1 6:rpdo1 --heartbeat 100 --json")
        said = ["link-guarded", "heartbeat-and-guarding"]  # the second is so already: 0x1017 is not 0
        assert (ran.code, [one["rule"] for one in ran.documents[-1]["findings"]]) == (1, said)
        assert value(bench, "1:1017") == before
        assert bench.run("node 1").code == 0
        assert bench.run("write 100D 0").code == 0
        assert bench.run("link 1:tpdo1 6:rpdo1 --heartbeat 100").code == 0
        assert value(bench, "1:1017") == 100


@heavy
def test_what_moves_a_drive_is_named_in_the_plan_and_in_the_question() -> None:
    """A statusword enables no drive unseen; a link on nodes that are OPERATIONAL is asked about with these words."""
    with Bench(("gen4@1", "generic@6")) as bench:
        for line in ("map 1:tpdo1 6041 606C", "map 6:rpdo1 6040 60FF --off", "nmt start 6"):
            assert bench.run(line).code == 0, line
        said = "of 1:tpdo1 goes to 6040:00"
        planned = bench.run("link 1:tpdo1 6:rpdo1 --dry-run")
        assert (planned.code, said in planned.stderr) == (0, True)
        refused = bench.run("link 1:tpdo1 6:rpdo1")
        refused.failed(6, said)
        found = bench.run("link 1:tpdo1 6:rpdo1 --yes --json").document["nodes"][1]["findings"]
        rules = {one["rule"]: one["severity"] for one in found}
        assert (rules["link-command"], rules["link-target"]) == ("warning", "note")


def test_quiet_shows_that_a_controlword_moves_the_drive() -> None:
    with Bench(("gen4@1", "tmcm@5")) as bench:
        refused = bench.run("link 1:tpdo2 5:rpdo1")
        refused.failed(1, "map 5:rpdo1 OBJECT… --off")
        assert "map 1:tpdo2" not in refused.stderr
        assert bench.run("map 1:tpdo2 6077").code == 0
        for line in ("link 1:tpdo2 5:rpdo1 --dry-run --quiet", "link 1:tpdo2 5:rpdo1 --quiet"):
            ran = bench.run(line)
            assert ran.code == 0
            assert "a controlword moves the drive" in ran.stderr
            assert "note:" not in ran.stderr


LINKED_FILE = """\
nodes:
  a: {node_id: 1, dcf: gen4, tpdo: {1: {mapping: [6041]}}}
  b:
    node_id: 6
    dcf: generic
    rpdo:
      1:
        enabled: true
        cob_id: 0x206
        mapping: [6040]
links: [{from: "a:tpdo1", to: "b:rpdo1"}]
"""


def test_a_file_that_gives_a_linked_rpdo_another_can_id_is_told_which_line_to_remove(
    bench: Bench, tmp_path: Path
) -> None:
    """As after `import`, which writes the COB-ID of each RPDO."""
    path = tmp_path / "net.yaml"
    path.write_text(LINKED_FILE)
    for command in ("check", "plan"):
        ran = bench.run(f"{command} {path}")
        assert ran.code
        said = "remove cob_id: (line 9) of 6:rpdo1: the link gives it the CAN-ID of its TPDO"
        assert said in ran.stdout + ran.stderr
    path.write_text(LINKED_FILE.replace("        cob_id: 0x206\n", ""))
    for command in ("check", "plan", "apply"):
        assert bench.run(f"{command} {path}").code == 0
    assert (pdos(bench, 6)["rpdo1"]["cob_id"], pdos(bench, 6)["rpdo1"]["enabled"]) == (0x181, True)


def test_a_link_to_an_rpdo_that_the_file_disables_is_warned_of(bench: Bench, tmp_path: Path) -> None:
    """As after `import` of an RPDO that is off: it would receive nothing."""
    path = tmp_path / "net.yaml"
    path.write_text(LINKED_FILE.replace("enabled: true", "enabled: false"))
    ran = bench.run(f"check {path}")
    assert "remove cob_id: (line 9) and enabled: false of 6:rpdo1" in ran.stdout + ran.stderr
    path.write_text(LINKED_FILE.replace("enabled: true", "enabled: false").replace("        cob_id: 0x206\n", ""))
    for command in ("check", "plan"):
        document = bench.run(f"{command} {path} --json").document
        found = document["files"][0]["findings"] if command == "check" else document["nodes"][1]["findings"]
        said = {(one["rule"], one["severity"], one["hint"]) for one in found}
        assert ("link-off", "warning", "remove enabled: false of 6:rpdo1, or the link") in said
    path.write_text(LINKED_FILE.replace("        enabled: true\n        cob_id: 0x206\n", ""))
    assert "link-off" not in bench.run(f"check {path}").stdout
