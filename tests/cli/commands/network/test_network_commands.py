"""`plan`, `diff`, `verify` and `apply` of a network file on simulated nodes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy
from tests.small_eds import plain

FILE = """
nodes:
  drive:
    node_id: 1
    tpdo:
      1: {cob_id: 0x201, transmission: 1, mapping: [6C01:01, velocity_actual_value, statusword]}
      2: {enabled: false}
  motor:
    node_id: 5
    heartbeat_producer: 700
    rpdo:
      3: {cob_id: 0x201, enabled: true}
"""


def held(bench: Bench) -> list[object]:
    """Every PDO of both nodes, and a heartbeat time."""
    rows = [bench.run(f"node {node_id}").code or bench.run("pdo --all --json").document for node_id in (1, 5)]
    return [*rows, bench.run("read 1017 --json").document["value"]]


@heavy
def test_a_plan_writes_nothing_and_after_apply_it_is_empty(bench: Bench, file: Path) -> None:
    before = held(bench)
    planned = bench.run(f"plan {file} --json")
    assert (planned.code, planned.document["changed"], planned.document["writes"]) == (0, True, 12)
    assert bench.run(f"plan {file} --exit-code").code == 3
    assert bench.run(f"diff {file}").code == 3
    assert bench.run(f"verify {file}").code == 3
    assert held(bench) == before
    applied = bench.run(f"apply {file} --json")
    assert (applied.code, applied.document["writes"], applied.document["stored"]) == (0, 12, [])
    for line in ("plan {} --exit-code", "diff {}", "verify {}"):
        assert bench.run(line.format(file)).code == 0
    again = bench.run(f"apply {file} --json")
    assert (again.code, again.document["writes"]) == (0, 0)
    assert bench.run("undo --all").code == 0
    assert held(bench) == before


def test_only_what_it_needs_is_read(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "two.yaml"
    path.write_text("n:\n  node_id: 1\n  tpdo:\n    4: {inhibit_ms: 40.0, event_timer: 50}\n")
    asked: list[int] = []
    bench.session.open_network().bus.tap(lambda frame, sent: asked.append(frame.can_id) if sent else None)
    planned = bench.run(f"plan {path} --json")
    assert planned.document["nodes"][0]["pdos"] == [
        {"pdo": "tpdo4", "action": "change", "inhibit_time": [0, 400], "event_timer": [0, 50]}
    ]
    assert len(asked) < 80, "the rules of networks look at what is enabled, and no PDO that is off is read"


@heavy
def test_a_saved_plan_is_applied_once_and_refused_where_it_is_stale(bench: Bench, file: Path, tmp_path: Path) -> None:
    saved = tmp_path / "plan.json"
    assert bench.run(f"plan {file} -o {saved}").code == 0
    assert json.loads(saved.read_text())["schema"] == "dvtcli.plan/1"
    assert bench.run("set 1:tpdo1 --timer 7").code == 0
    before = held(bench)
    ran = bench.run(f"apply {saved} --json")
    assert (ran.code, ran.documents[-1]["state"], ran.documents[-1]["node"]) == (6, "unchanged", 1)
    assert held(bench) == before
    assert bench.run("undo").code == 0
    assert bench.run(f"apply {saved}").code == 0
    assert bench.run(f"diff {file}").code == 0


def test_a_pdo_that_gets_a_mapping_and_stays_off_is_said_to(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "off.yaml"
    path.write_text("n: {node_id: 1, tpdo: {1: {mapping: [6041]}, 4: {mapping: [6041]}}}\n")
    assert bench.run("set tpdo1 --off").code == bench.run("enable tpdo4").code == 0
    shown = bench.run(f"plan {path}").stdout.splitlines()
    assert [line for line in shown if "TPDO" in line] == ["  ~ TPDO4"]
    path.write_text("n: {node_id: 1, tpdo: {1: {mapping: [606C]}, 4: {mapping: [606C]}}}\n")
    shown = bench.run(f"plan {path}").stdout.splitlines()
    assert [line for line in shown if "TPDO" in line] == [
        "  ~ TPDO1  stays off: the file does not enable it",
        "  ~ TPDO4",
    ]
    path.write_text("n: {node_id: 1, tpdo: {1: {mapping: [606C], enabled: false}}}\n")
    shown = bench.run(f"plan {path}").stdout.splitlines()
    assert [line for line in shown if "TPDO" in line] == ["  ~ TPDO1  stays off"]


BESIDE = """nodes:
  first: {node_id: 5, tpdo: {1: {cob_id: 0x1A0}}}
  second: {node_id: 6, heartbeat_producer: 700, tpdo: {1: {transmission: 255}}}
"""


_MOVED, _SLOWER = "set 6:tpdo1 --cob-id 0x1A0", "write 1017 800 --as u16"


@heavy
@pytest.mark.parametrize(("line", "nothing"), [(_MOVED, False), (_SLOWER, False), (_SLOWER, True)])
def test_a_saved_plan_is_stale_where_a_node_that_it_does_not_change_has_changed(
    line: str, nothing: bool, tmp_path: Path
) -> None:
    file, saved = tmp_path / "beside.yaml", tmp_path / "plan.json"
    file.write_text(BESIDE)
    with Bench(("generic@5", "generic@6"), {"yes": True}) as bench:
        assert bench.run("node 6").code == bench.run("write 1017 700 --as u16").code == 0
        assert not nothing or bench.run("set 5:tpdo1 --cob-id 0x1A0").code == 0
        assert bench.run(f"plan {file} -o {saved}").code == 0
        assert bench.run(line).code == 0
        ran = bench.run(f"apply {saved} --json")
        assert (ran.code, ran.documents[-1]["node"], ran.documents[-1]["state"]) == (6, 6, "unchanged")
        assert bench.run("undo").code == 0
        assert bench.run(f"apply {saved}").code == 0


@heavy
def test_a_plan_for_another_device_is_refused(bench: Bench, file: Path, tmp_path: Path) -> None:
    saved = tmp_path / "plan.json"
    assert bench.run(f"plan {file} -o {saved}").code == 0
    document = json.loads(saved.read_text())
    document["nodes"][1]["identity"]["product"] += 1
    saved.write_text(json.dumps(document))
    assert bench.run(f"apply {saved}").code == 6
    file.write_text(FILE.replace("node_id: 5", "node_id: 5\n    identity: {vendor: 0x99}"))
    ran = bench.run(f"plan {file} --json")
    assert ran.code == 6
    assert "node 5 has vendor" in ran.documents[-1]["text"]


def test_a_damaged_plan_is_said(bench: Bench, tmp_path: Path) -> None:
    saved = tmp_path / "plan.json"
    for text in ("{", "{}", '{"schema":"dvtcli.plan/1","nodes":[{"node":1,"changes":[{}],"identity":{}}]}'):
        saved.write_text(text)
        assert bench.run(f"apply {saved}").code == 4
    assert bench.run(f"apply {tmp_path / 'none.json'}").code == 2


def test_all_findings_of_all_nodes_are_said_at_once_and_nothing_is_sent(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text("""
a:
  node_id: 1
  tpdo:
    1: {mapping: [6C01:01, nothing_like_it]}
b:
  node_id: 5
  sdo: [{index: 0x6060, value: 1000}]
""")
    ran = bench.run(f"apply {path} --json")
    assert ran.code == 4
    assert [(one["line"], one["column"]) for one in ran.documents[-1]["complaints"]] == [(5, 28), (8, 32)]
    path.write_text("""
a: {node_id: 1, tpdo: {1: {mapping: [1018:01]}}}
b: {node_id: 5, tpdo: {1: {mapping: [1018:01]}}}
""")
    ran = bench.run(f"apply {path} --json")
    assert (ran.code, ran.documents[-1]["state"]) == (1, "unchanged")
    assert len(ran.documents[-1]["findings"]) == 2


@heavy
def test_two_producers_of_one_can_id_are_refused_and_an_exchange_is_not(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "clash.yaml"
    both = "a: {{node_id: 1, tpdo: {{1: {{cob_id: {0}}}}}}}\nb: {{node_id: 5, tpdo: {{1: {{cob_id: {1}}}}}}}\n"
    path.write_text(both.format("0x2A0", "0x2A0"))
    ran = bench.run(f"apply {path} --json")
    assert (ran.code, ran.documents[-1]["findings"][0]["rule"]) == (1, "can-id-clash")
    path.write_text(both.format("0x185", "0x181"))
    assert bench.run(f"apply {path}").code == 0
    assert bench.run(f"diff {path}").code == 0


def test_a_dry_run_reaches_the_twins_only(bench: Bench, file: Path) -> None:
    before = held(bench)
    ran = bench.run(f"apply {file} --dry-run")
    assert ran.code == 0
    assert "Nothing was written." in ran.stdout
    assert held(bench) == before


def test_without_consent_nothing_is_written(file: Path) -> None:
    with Bench(("gen4@1", "tmcm@5")) as bench:
        before = held(bench)
        ran = bench.run(f"apply {file} --json")
        assert (ran.code, ran.documents[-1]["state"]) == (6, "unchanged")
        assert "--yes" in ran.documents[-1]["hint"]
        assert held(bench) == before


@heavy
def test_nodes_store_once_all_are_verified(bench: Bench, file: Path) -> None:
    file.write_text("defaults: {store: true}\n" + FILE)
    ran = bench.run(f"apply {file} --json")
    assert (ran.code, [one["node"] for one in ran.document["stored"]]) == (0, [1, 5])
    assert bench.run("nmt reset-node all").code == 0
    assert bench.run(f"diff {file}").code == 0


def test_what_a_file_does_not_name_goes_off_with_prune(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "prune.yaml"
    path.write_text("n: {node_id: 1, prune: true, tpdo: {1: {enabled: true}}}\n")
    assert bench.run(f"apply {path}").code == 0
    assert bench.run("node 1").code == 0
    enabled = [one["pdo"] for one in bench.run("pdo --all --json").document["pdos"] if one["enabled"]]
    assert enabled == ["tpdo1"]


@heavy
def test_what_is_right_and_not_stored_is_stored_by_the_next_apply_that_should(bench: Bench, file: Path) -> None:
    assert bench.run(f"apply {file}").code == 0
    file.write_text("defaults: {store: true}\n" + FILE)
    planned = bench.run(f"plan {file}")
    assert "not stored yet: TPDO1, TPDO2" in planned.stdout
    assert "0 SDO writes, a store on nodes 1 and 5" in planned.stdout
    assert "No difference" not in planned.stdout
    assert "but not everything is stored" in planned.stdout
    for line in (f"plan {file} --exit-code", f"diff {file}"):
        assert bench.run(line).code == 3
    assert bench.run(f"plan {file}").code == 0
    assert "of node 1: not stored yet: TPDO1, TPDO2" in bench.run(f"diff {file} --format github").stdout
    assert 'failures="2"' in bench.run(f"diff {file} --format junit").stdout
    ran = bench.run(f"apply {file} --json")
    assert (ran.code, ran.document["writes"], len(ran.document["stored"])) == (0, 0, 2)
    assert bench.run(f"plan {file} --exit-code").code == 0
    assert bench.run(f"apply {file} --json").document["stored"] == []
    assert bench.run("nmt reset-node all").code == 0
    assert bench.run(f"diff {file}").code == 0


@pytest.mark.parametrize(
    ("mapping", "rule"),
    [("[60FF:00]", "frame-too-long"), ("[60FF:00, dummy/32]", "frame-too-short"), ("[60FF:00, dummy/16]", "")],
)
def test_a_consumer_that_is_mapped_for_another_length_is_told(tmp_path: Path, mapping: str, rule: str) -> None:
    """As `check` does: that the rest is dropped is a warning, that the frame is ignored an error; also if it is so."""
    path = tmp_path / "pair.yaml"
    path.write_text(
        "a: {node_id: 1, tpdo: {1: {cob_id: 0x2A1, mapping: [606C:00, statusword]}}}\n"
        f"b: {{node_id: 2, rpdo: {{1: {{cob_id: 0x2A1, mapping: {mapping}}}}}}}\n"
    )
    with Bench(("generic@1", "generic@2"), {"yes": True}) as bench:
        for line in ("plan", "apply", "plan"):
            ran = bench.run(f"{line} {path} --json")
            assert ran.code == (1 if rule == "frame-too-short" else 0)
            bench.run(f"apply {path} --force")
        found = bench.run(f"plan {path} --json --force").document["nodes"][1]["findings"]
        texts = [one["text"] for one in found if one["rule"] == rule]
        assert len(texts) == bool(rule)
        assert all("of node 1 sends 48" in text for text in texts)
        assert "consumer-length" not in {one["rule"] for one in found}, "it is said once"


def test_how_many_of_which_differ_is_said(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text("nodes: {motor: {node_id: 5, heartbeat_producer: 700, tpdo: {1: {transmission: 7}}}}")
    ran = bench.run(f"verify {path}")
    assert (ran.code, f"2 of 2 (1 PDO and 1 object) of node 5 differ from {path}") == (3, ran.stdout.splitlines()[-1])


ALL_WRONG = """
a: {node_id: 1, tpdo: {1: {mapping: [nothing_like_it]}}}
b: {node_id: 5, identity: {vendor: 0x99}, tpdo: {1: {mapping: [nothing_like_it]}}}
c: {node_id: 7}
d: {node_id: 8}
"""


def test_all_that_is_wrong_with_any_node_is_said_at_once(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(ALL_WRONG)
    ran = bench.run(f"plan {path}")
    assert ran.code == 6
    assert "node 5 has vendor 0x00000286, not 0x00000099" in ran.stderr.splitlines()[0]
    assert f"  also    {path}:2:38: " in ran.stderr
    assert "  also    nodes 7 and 8 do not answer" in ran.stderr
    path.write_text(ALL_WRONG.replace("0x99", "0x286"))
    ran = bench.run(f"plan {path} --json")
    assert (ran.code, [one["line"] for one in ran.document["complaints"]]) == (4, [2, 3])
    assert ran.document["also"] == ["nodes 7 and 8 do not answer"]
    shown = bench.run(f"plan {path}").stderr.splitlines()
    assert shown[-2:] == ["2 errors. Nothing was written.", "  also    nodes 7 and 8 do not answer"]
    path.write_text(ALL_WRONG.replace("0x99", "0x286").replace("nothing_like_it", "1018:01"))
    ran = bench.run(f"plan {path}")
    assert (ran.code, ran.stderr.count("is not mappable")) == (1, 2)
    assert "  also    nodes 7 and 8 do not answer" in ran.stderr
    path.write_text(ALL_WRONG.replace("0x99", "0x286").replace("nothing_like_it", "statusword"))
    ran = bench.run(f"plan {path} --json")
    assert (ran.code, ran.document["error"], ran.document["also"]) == (5, "no_answer", [])


def test_a_node_of_which_a_file_asks_nothing_is_not_said_to_hold_it(tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    file.write_text("a: {node_id: 5}\nb: {node_id: 9, tpdo: {1: {event_timer: 0}}}\n", "utf-8")
    with Bench(("generic@5", "generic@9")) as bench:
        for word in ("plan", "diff"):
            ran = bench.run(f"{word} {file}")
            assert (ran.code, ran.stderr.count("node 5: the file has no settings for it")) == (0, 1), ran
            assert "every node that the file sets has the values of the file" in ran.stdout
        file.write_text("a: {node_id: 5}\n", "utf-8")
        assert "No difference: the file has no settings. Nothing was written." in bench.run(f"diff {file}").stdout
        assert bench.run(f"apply {file}").stdout == "The file has no settings; nothing was written.\n"


def test_a_plan_shows_29_bits_with_eight_digits(tmp_path: Path) -> None:
    """0x1AB of 29 bits and 0x1AB of 11 bits are two CAN-IDs."""
    text = "a: {node_id: 5, dcf: generic, tpdo: {1: {enabled: true, cob_id: 0x200001AB}}}\n"
    (tmp_path / "net.yaml").write_text(text)
    with Bench(("generic@5",), {"yes": True}) as bench:
        planned = bench.run(f"plan {tmp_path}/net.yaml")
        report = bench.run(f"diff {tmp_path}/net.yaml --format junit")
    assert "0x185  ->  0x000001AB" in planned.stdout, planned
    assert "cob_id is 0x185, expected 0x000001AB" in report.stdout, report


def test_one_place_of_a_file_has_a_finding_once(tmp_path: Path) -> None:
    """Two equal dummies are one word of the file; each of two words has its own finding."""
    eds, file = tmp_path / "nod.eds", tmp_path / "net.yaml"
    made = plain()
    made.dummies = ()
    eds.write_text(made.text(), "utf-8")
    for mapping, count in (("[dummy/16, 6200:01, dummy/16]", 1), ("[0003/16, 6200:01, 0003/16]", 2)):
        file.write_text(f"b: {{node_id: 6, dcf: nod.eds, rpdo: {{1: {{mapping: {mapping}}}}}}}\n", "utf-8")
        with Bench((f"{eds}@6",)) as bench:
            checked = bench.run(f"check {file}")
            assert (checked.code, checked.stdout.count("has no dummy 0003:00/16")) == (4, count)
            planned = bench.run(f"plan {file}")
            assert (planned.code, planned.stderr.count("has no dummy 0003:00/16")) == (1, count)
            assert [place in planned.stderr for place in ("0x1600:01", "0x1600:03")] == [True, True]
