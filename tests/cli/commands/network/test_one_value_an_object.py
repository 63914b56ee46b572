"""Lines of a network file that want different values of one object: told, with both lines; none wins over another."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy
from tests.small_eds import plain, var

ENTRIES = 3


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    eds = plain()
    eds.variable(0x2000, var("Controller gain", 6, 0))
    eds.record(0x1016, "Consumer heartbeat time", {sub: var(f"Time {sub}", 7, 0) for sub in range(1, ENTRIES + 1)})
    Path("three.eds").write_text(eds.text(), "utf-8")


def net(*lines: str) -> str:
    Path("net.yaml").write_text("\n".join(("b:", "  node_id: 9", *(f"  {line}" for line in lines))) + "\n", "utf-8")
    return "net.yaml"


def hold(bench: Bench, *entries: int) -> None:
    """Node 9 has these in 0x1016:01 and on."""
    sdo = bench.session.node(9).sdo
    for sub_index in range(1, ENTRIES + 1):
        sdo.download(0x1016, sub_index, bytes(4))
    for sub_index, value in enumerate(entries, 1):
        sdo.download(0x1016, sub_index, value.to_bytes(4, "little"))


def held(bench: Bench) -> list[int]:
    sdo = bench.session.node(9).sdo
    return [int.from_bytes(sdo.upload(0x1016, sub_index), "little") for sub_index in range(1, ENTRIES + 1)]


@pytest.mark.parametrize("other", ['"2000:00"', "0x2000", "controller_gain", "Controller gain"])
def test_a_name_and_a_number_of_one_object_have_one_value(other: str) -> None:
    first, second = "- {object: 2000, value: 1}", f"- {{object: {other}, value: 2}}"
    with Bench(("three.eds@9",), {"yes": True}) as bench:
        for word in ("plan", "diff", "verify", "apply"):
            ran = bench.run(f"{word} {net('sdo:', first, second)}")
            assert (ran.code, ran.stdout) == (4, ""), word
            assert "has another value already (line 4" in ran.stderr or "has a value already (line 4)" in ran.stderr
        assert bench.session.node(9).sdo.upload(0x2000, 0) == bytes(2)


def test_the_same_value_twice_is_no_fault() -> None:
    with Bench(("three.eds@9",)) as bench:
        assert bench.run(f"plan {net('sdo:', '- {object: 2000, value: 2}', '- {object: controller_gain, value: 0x2}')}")
        assert bench.run("plan net.yaml").code == 0


def test_a_link_sets_no_heartbeat_that_another_line_sets_otherwise() -> None:
    nodes = "a: {node_id: 1, heartbeat_producer: 250}\nb: {node_id: 2}\nlinks:\n"
    first, second = (
        f"  - {{from: a:tpdo{number}, to: b:rpdo{number}, heartbeat: {time_ms}}}\n"
        for number, time_ms in ((1, 500), (2, 700))
    )
    with Bench(("generic@1", "generic@2")) as bench:
        for text, line in ((nodes + first, 1), (nodes.replace(", heartbeat_producer: 250", "") + first + second, 4)):
            Path("net.yaml").write_text(text, "utf-8")
            ran = bench.run("plan net.yaml")
            assert (ran.code, ran.stdout) == (4, "")
            assert f"0x1017:00 has another value already (line {line}: heartbeat_producer)" in ran.stderr
        Path("net.yaml").write_text(nodes.replace("250", "500") + first, "utf-8")
        assert bench.run("plan net.yaml").code == 0


def test_a_link_that_sets_the_heartbeat_is_what_the_others_wait_for() -> None:
    Path("net.yaml").write_text(
        "a: {node_id: 1}\nb: {node_id: 2}\nlinks:\n  - {from: a:tpdo1, to: b:rpdo1}\n"
        "  - {from: a:tpdo2, to: b:rpdo2, heartbeat: 3000}\n", "utf-8",
    )  # fmt: skip
    with Bench(("generic@1", "generic@2"), {"yes": True}) as bench:
        assert bench.run("apply net.yaml").code == 0
        assert bench.session.node(2).sdo.upload(0x1016, 1) == bytes.fromhex("28 23 01 00")


@pytest.mark.parametrize("entry", [0x0001_07D0, 0x0007_07D0])
def test_a_link_waits_as_long_as_sdo_says_or_says_that_no_entry_is_left(entry: int) -> None:
    Path("net.yaml").write_text(
        f"a: {{node_id: 1}}\nb: {{node_id: 2, sdo: [{{object: '1016:01', value: 0x{entry:08X}}}]}}\n"
        "links: [{from: a:tpdo1, to: b:rpdo1}]\n", "utf-8",
    )  # fmt: skip
    with Bench(("generic@1", "generic@2"), {"yes": True}) as bench:
        bench.session.node(2).sdo.download(0x1016, 1, bytes.fromhex("E8030100"))
        ran = bench.run("apply net.yaml")
        assert (ran.code, "0x1016 has no free entry" in ran.stderr) == (0, entry >> 16 != 1)
        assert bench.session.node(2).sdo.upload(0x1016, 1) == entry.to_bytes(4, "little")
        assert bench.run("plan net.yaml --exit-code").code == 0


def test_an_entry_that_one_line_frees_is_another_s() -> None:
    with Bench(("generic@9",), {"yes": True}) as bench:
        bench.session.node(9).sdo.download(0x1016, 1, bytes.fromhex("F4010400"))
        assert bench.run(f"apply {net('heartbeat_consumer: {4: 0, 5: 1500}')}").code == 0
        assert bench.session.node(9).sdo.upload(0x1016, 1) == bytes.fromhex("DC050500")


def test_who_is_watched_stands_beside_the_entries_that_sdo_sets() -> None:
    seven = '- {object: "1016:01", value: 0x000703E8}'
    with Bench(("three.eds@9",), {"yes": True}) as bench:
        assert bench.run(f"apply {net('heartbeat_consumer: {4: 1500}', 'sdo:', seven)}").code == 0
        assert held(bench) == [0x0007_03E8, 0x0004_05DC, 0]
        for word in ("verify", "diff", "plan --exit-code"):
            assert bench.run(f"{word} net.yaml").code == 0
        assert bench.run(f"plan {net('heartbeat_consumer: {7: 1000}', 'sdo:', seven)} --exit-code").code == 0
        for time_ms in (0, 500):
            ran = bench.run(f"plan {net(f'heartbeat_consumer: {{7: {time_ms}}}', 'sdo:', seven)}")
            assert (ran.code, ran.stdout) == (4, "")
            assert "net.yaml:3:24: error: 0x1016:01 has another value already (line 5" in ran.stderr


def test_where_sdo_fills_every_entry_nobody_else_is_watched() -> None:
    filled = [f'- {{object: "1016:0{sub}", value: 0x000{sub}0064}}' for sub in range(1, ENTRIES + 1)]
    with Bench(("three.eds@9",), {"yes": True}) as bench:
        ran = bench.run(f"plan {net('heartbeat_consumer: {4: 1500}', 'sdo:', *filled)}")
        assert (ran.code, ran.stdout) == (4, "")
        assert "0x1016 of node 9 has no free entry (3 in all, 3 of them as sdo has it)" in ran.stderr


@heavy
@pytest.mark.parametrize(
    "entries",
    [(), (0x0004_05DC,), (0, 0x0004_05DC), (0x0005_01F4, 0, 0x0004_05DC), (0x0006_0064, 0x0005_01F4, 0x0004_05DC)],
)
def test_what_import_writes_of_0x1016_is_what_is_compared_and_put_back(entries: tuple[int, ...]) -> None:
    with Bench(("three.eds@9",), {"yes": True}) as bench:
        hold(bench, *entries)
        before = held(bench)
        assert bench.run("import net.yaml").code == 0
        assert bench.run("plan net.yaml --exit-code").code == 0
        assert bench.run("verify net.yaml").code == 0
        hold(bench)
        assert bench.run("diff net.yaml").code == (3 if any(entries) else 0)
        assert bench.run("apply net.yaml").code == 0
        assert sorted(held(bench)) == sorted(before)
        assert bench.run("diff net.yaml").code == 0


def test_an_entry_that_import_found_empty_is_free_for_who_is_added_later() -> None:
    with Bench(("three.eds@9",), {"yes": True}) as bench:
        hold(bench, 0x0005_01F4)
        assert bench.run("import net.yaml").code == 0
        file = Path("net.yaml")
        file.write_text(file.read_text("utf-8").replace("5: 500", "5: 500\n      4: 1500"), "utf-8")
        assert bench.run("apply net.yaml").code == 0
        assert sorted(held(bench)) == [0, 0x0004_05DC, 0x0005_01F4]
        assert bench.run("verify net.yaml").code == 0
