"""`load`: from a file without a bus, from nodes, and what is heard beside what is computed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from dvtcli.cli.view.answers.load_lines import load_lines
from dvtcli.cli.view.lines import Line
from dvtcli.operations.network.network_load import LoadOptions, load_after, network_load
from dvtcli.operations.plans.plan_network import plan_network
from dvtcli.operations.session.simulated_nodes import simulated_device, simulated_nodes
from tests.cli.commands.bench import Bench, Ran
from tests.harness.sample import heavy
from tests.process import ROOT, dvtcli
from tests.virtual_time import VirtualTimeBus

LINE = ROOT / "examples" / "line.yaml"


@pytest.fixture
def nothing() -> Iterator[Bench]:
    """A session without any bus."""
    with Bench(()) as made:
        yield made


def frames(ran: Ran) -> dict[int, dict[str, Any]]:
    """Of each CAN-ID what is computed."""
    return {one["cob_id"]: one["worst"][0] for one in ran.document["frames"] if one["worst"]}


def test_a_file_alone(nothing: Bench) -> None:
    ran = nothing.run(f"load {LINE} --at 125000 --json")
    assert (ran.code, ran.document["fits"], ran.document["measured"], ran.document["bus"]) == (0, True, None, None)
    assert ran.document["fitting_bit_rates"] == [125_000, 250_000, 500_000, 800_000, 1_000_000]
    assert sorted(frames(ran)) == [0x081, 0x085, 0x181, 0x185, 0x701, 0x705]
    assert (frames(ran)[0x181]["period_us"], frames(ran)[0x181]["length"]) == (10_000, 6)
    assert sum(one["load"] for one in frames(ran).values()) == pytest.approx(ran.document["load"], abs=1e-5)
    assert not nothing.session.is_open


def test_the_text_has_bars_and_says_what_is_assumed(nothing: Bench) -> None:
    ran = nothing.run(f"load {LINE}")
    assert "at 500 kbit/s (assumed: -b sets another), at worst" in ran.stdout
    assert "0x185   TPDO1         5    3  inhibit 5 ms" in ran.stdout
    assert "████████████" in ran.stdout
    assert "every frame meets its deadline in the worst case" in ran.stdout
    assert "assumed: 2 nodes send an EMCY each 1000 ms at most" in ran.stdout


@heavy
def test_what_has_no_limit_is_never_nothing(nothing: Bench) -> None:
    ran = nothing.run(f"load {LINE} --inhibit 1:tpdo1=0 --json")
    assert (ran.document["load"], ran.document["unlimited"], ran.document["fits"]) == (0.03736, [], True)
    assert nothing.run(f"load {LINE} --inhibit drive:tpdo1=0 --json").document == ran.document
    unlimited = LINE.read_text().replace("inhibit_ms: 10\n        event_timer: 100", "inhibit_ms: 0")
    Path("unlimited.yaml").write_text(unlimited)
    ran = nothing.run("load unlimited.yaml --json")
    assert (ran.document["load"], ran.document["unlimited"], ran.document["fits"]) == (None, ["1:tpdo1"], False)
    assert frames(ran)[0x181]["load"] is None
    text = nothing.run("load unlimited.yaml").stdout
    assert "load  unbounded; all other frames: 3.51 % at worst" in text
    assert "1:tpdo1: event-driven, without inhibit time and event timer\n      hint: --inhibit" in text
    mended = nothing.run("load unlimited.yaml --inhibit 1:tpdo1=40 --json")
    assert mended.document["fits"]


def test_a_bit_rate_may_be_written_with_k_here_and_at_the_start(nothing: Bench) -> None:
    in_bits = nothing.run(f"load {LINE} --json --at 125000").document
    assert in_bits["bit_rate"] == 125_000
    assert nothing.run(f"load {LINE} --json --at 125k").document == in_bits
    at_the_start = dvtcli("-b", "125k", "load", str(LINE), "--json")
    assert json.loads(at_the_start.stdout)["bit_rate"] == 125_000


def test_a_node_of_which_nothing_is_known_counts_with_what_the_file_says(nothing: Bench) -> None:
    ran = nothing.run(f"load {ROOT / 'examples' / 'press.yaml'} --json --sync 10")
    assert [text for text in ran.document["assumed"] if text.startswith("of node 5 only")]
    assert (frames(ran)[0x485]["length"], frames(ran)[0x485]["period_us"]) == (8, 40_000)
    assert frames(ran)[0x201]["why"] == "SYNC"


@pytest.mark.parametrize(
    ("line", "code", "said"),
    [
        ("load nowhere.yaml", 2, "nowhere.yaml"),
        ("load {} --inhibit 9:tpdo1=10", 2, "--inhibit 9:tpdo1: no node of the network has it"),
        ("load {} --inhibit drivel:tpdo1=10", 2, "--inhibit drivel:tpdo1: no node of the network has it"),
        ("load {} --inhibit 0x80:tpdo1=10", 2, "0x80"),
        ("load {} --inhibit tpdo1=10", 2, "--inhibit tpdo1: which node's?"),
        ("load {} --inhibit rpdo1=10", 2, "only TPDOs are inhibited"),
        ("load {} --inhibit 1:tpdo1", 2, "is not [NODE:]tpdoN=MS"),
        ("load {} --inhibit 1:tpdo1=0.05", 2, "0.05"),
        ("load {} --at 5", 2, "is not a bit rate"),
        ("load {} --sync 0", 2, "0 ms is not within"),
    ],
)
def test_what_cannot_be_meant(nothing: Bench, line: str, code: int, said: str) -> None:
    ran = nothing.run(line.format(LINE))
    assert ran.code == code
    assert said in ran.stderr


def test_a_wrong_file_is_said_as_everywhere(nothing: Bench) -> None:
    Path("wrong.yaml").write_text(LINE.read_text().replace("velocity_actual_value", "velocity_actual_valu"))
    ran = nothing.run("load wrong.yaml")
    assert ran.code == 4
    assert "wrong.yaml:17:28: error:" in ran.stderr


def _virtual(*words: str) -> VirtualTimeBus:
    return VirtualTimeBus([simulated_device(one) for one in simulated_nodes(words)])


LIVE = ("map 1:tpdo1 6041 606C --event --timer 10", "disable 1:tpdo2", "map 5:tpdo1 6000:01 --event --timer 3",
        "disable 5:tpdo2", "node 1", "write 1017 100", "node 5", "write 1017 200", "nmt start all")  # fmt: skip


@heavy
def test_what_is_heard_is_what_is_computed() -> None:
    """Twenty seconds of the bus's own time: the computed rates and the frames that came differ by less than 2 %."""
    with Bench((), {"sim": (), "yes": True, "bitrate": 125_000}, _virtual("gen4@1", "generic@5")) as bench:
        for line in LIVE:
            _ok(bench, line)
        ran = bench.run("load --for 20 --json")
    measured = ran.document["measured"]
    assert measured["seconds"] == pytest.approx(20, abs=0.01)
    assert measured["load"] == pytest.approx(measured["expected_load"], rel=0.02)
    assert measured["load"] > 0.2
    by_id = {one["cob_id"]: one for one in ran.document["frames"]}
    assert by_id[0x185]["measured"]["rate_hz"] == pytest.approx(1000 / 3, rel=0.02)
    for one in by_id.values():
        if one["measured"] and one["worst"]:
            assert one["measured"]["load"] <= 1.02 * sum(need["load"] for need in one["worst"])


def _ok(bench: Bench, line: str) -> None:
    ran = bench.run(line)
    assert ran.code == 0, (line, ran.stderr)


def test_the_load_after_a_plan(tmp_path: Path) -> None:
    with Bench(("gen4@1", "generic@5"), {"bitrate": 125_000}) as bench:
        need = load_after(bench.session, plan_network(bench.session, str(LINE)))
    assert need is not None
    assert need.total is not None
    with Bench(()) as alone:
        ran = alone.run(f"load {LINE} --at 125000 --json")
    assert float(need.total) == pytest.approx(ran.document["load"], abs=1e-6)


OTHERS = "Frames of other nodes are not counted."


def test_a_plan_says_the_load_afterwards() -> None:
    with Bench(("gen4@1", "generic@5"), {"bitrate": 125_000}) as bench:
        assert f"Worst-case bus load at 125 kbit/s afterwards: 23.2 %. {OTHERS}" in bench.run(f"plan {LINE}").stdout
        document = bench.run(f"plan {LINE} --json").document["load"]
        assert (document["bit_rate"], document["unlimited"], document["fits"]) == (125_000, [], True)
        Path("two.yaml").write_text("nodes:\n  a: {node_id: 1}\n  b: {node_id: 5}\n")
        said = bench.run("plan two.yaml").stdout
    assert (
        "Worst-case bus load afterwards is unbounded: 1:tpdo1, 5:tpdo1, 5:tpdo2 (event-driven, without inhibit time "
        f"and event timer). All other frames: 11.2 % at 125 kbit/s. {OTHERS}\n"
    ) in said


def test_without_a_bit_rate_no_load_is_computed_after_a_plan() -> None:
    with Bench(("gen4@1", "generic@5")) as bench:
        assert load_after(bench.session, plan_network(bench.session, str(LINE))) is None


def test_json_of_a_bus_names_what_was_only_heard() -> None:
    with Bench(("gen4@1",)) as bench:
        ran = bench.run("load --for 0.3 --json")
        assert json.dumps(ran.document)
        assert ran.document["bus"] == "sim"
        received = [one for one in ran.document["frames"] if one["measured"]]
        assert {one["cob_id"] for one in received} <= {0x701}


TIMERS = """nodes:
  drive: {node_id: 1, tpdo: {1: {mapping: [6041, 606C], transmission: 255, event_timer: 15, inhibit_ms: 0}}}
"""


def test_what_comes_more_often_than_the_worst_case_of_the_file_is_said() -> None:
    Path("timers.yaml").write_text(TIMERS)
    with Bench((), {"sim": (), "yes": True, "bitrate": 125_000}, _virtual("gen4@1")) as bench:
        for line in ("map 1:tpdo1 6041 606C --event --timer 10 --inhibit 0", "nmt start all"):
            _ok(bench, line)
        document = bench.run("load timers.yaml --for 3 --json").document
        text = bench.run("load timers.yaml --for 3").stdout
        own = bench.run("load --for 3").stdout
    often = [one["cob_id"] for one in document["frames"] if one["measured"] and one["measured"]["too_often"]]
    assert often == [0x181]
    assert "too often  1:tpdo1 was received 100.0 times a second, 66.7 are computed at worst\n" in text
    assert "hint: dvtcli diff timers.yaml" in text
    assert "too often" not in own, "what the node holds is what it sends"


@pytest.mark.parametrize("for_s", [0.0, 0.5])
@pytest.mark.parametrize("width", [80, 100])
def test_a_row_fits_the_screen_and_says_what_limits_a_frame(width: int, for_s: float) -> None:
    """In virtual time: nothing is waited for."""
    bus = VirtualTimeBus([simulated_device(one) for one in simulated_nodes(("gen4@1", "generic@5"))], simulated=False)
    with Bench((), {"sim": (), "node": 1}, bus) as bench:
        loaded = network_load(bench.session, None, LoadOptions(for_s))
        lines = [text_of(line) for line in load_lines(loaded, width)]
    rows = [line for line in lines if line.startswith("  0x")]
    assert len(rows) >= 3
    assert max(map(len, rows)) <= width
    assert not any("…" in row for row in rows)
    assert any("10 ms" in row for row in rows)


def text_of(line: Line) -> str:
    return line if isinstance(line, str) else "".join(cell.text for cell in line)


def test_the_load_after_a_plan_counts_the_sync_of_the_files_master() -> None:
    """A synchronous TPDO is limited by it, as `load` of the same file says."""
    Path("sync.yaml").write_text(
        "master: {node_id: 127, sync_period: 10000}\n"
        "nodes:\n  a: {node_id: 1, tpdo: {1: {enabled: true, transmission: 1, mapping: [6041:00]}}}\n"
    )
    with Bench(("gen4@1",), {"bitrate": 250_000}) as bench:
        need = load_after(bench.session, plan_network(bench.session, "sync.yaml"))
        said = bench.run("plan sync.yaml")
        load = bench.run("load sync.yaml --json").document
    assert need is not None
    assert "no known node produces SYNC" not in said.stdout
    assert "sync" in {one.stream.kind for one in need.needs}
    assert float(need.limited) == pytest.approx(load["limited"] if "limited" in load else load["load"], abs=1e-6)
