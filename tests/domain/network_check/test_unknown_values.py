"""What nobody says stays unknown, or is the standard's default: no error, load or clash rests on an assumption."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from dvtcli.domain.network.check.check_bus import CHECKS_OF_BIT_RATE
from dvtcli.domain.network.check.network_rules import NETWORK_RULES, network_findings
from tests.cli.commands.bench import Bench
from tests.domain.network_check.planted import PLANTED, Planted
from tests.small_eds import U32, Eds, communication, plain, var

ALL = {rule.name for rule in NETWORK_RULES}
#: services whose COB-ID CiA 301 gives a default: object, and that of node 5
USUAL = {(0x1005, 0): 0x80, (0x1012, 0): 0x100, (0x1014, 0): 0x85}


def said(bench: Bench, line: str) -> dict[str, str]:
    """The rules that find something, each with its severity."""
    (file,) = bench.run(f"{line} --json").document["files"]
    return {found["rule"]: found["severity"] for found in file["findings"]}


@pytest.mark.parametrize("planted", PLANTED, ids=[f"{n}-{one.rule}" for n, one in enumerate(PLANTED)])
def test_without_a_bit_rate_no_rule_judges_by_one(planted: Planted) -> None:
    """Every other rule says what it says at each bit rate."""
    rules = ALL - CHECKS_OF_BIT_RATE
    unknown = planted._replace(bit_rate=None).network
    found = {(rule.name, spot) for rule, spot, _ in network_findings(unknown, ALL)}
    known = {(rule.name, spot) for rule, spot, _ in network_findings(planted._replace(bit_rate=125_000).network, rules)}
    assert {one for one in found if one[0] != "unknown-bit-rate"} == known


def busy(folder: Path, master: str) -> Path:
    """A network of eight nodes that send 1 byte every 2 ms: 8 TPDOs that a bus of 250 kbit/s has no room for."""
    (folder / "io.eds").write_text(plain().text(), "latin-1")
    nodes = "\n".join(
        f"n{node_id}: {{node_id: {node_id}, dcf: io.eds, tpdo: {{1: {{enabled: true, event_timer: 2}}}}}}"
        for node_id in range(1, 9)
    )
    file = folder / "busy.yml"
    file.write_text(f"{master}\n{nodes}", "utf-8")
    return file


@pytest.mark.parametrize(
    ("master", "options", "late", "unknown"),
    [
        ("", "", False, True),
        ("master: {node_id: 127}", "", False, True),
        ("master: {node_id: 127, baudrate: 1000}", "", False, False),
        ("master: {node_id: 127, baudrate: 125}", "", True, False),
        ("master: {node_id: 127, baudrate: 1000}", "--at 125000", True, False),
        ("", "--at 125000", True, False),
        ("", "--at 1000000", False, False),
    ],
)
def test_deadlines_are_judged_at_the_bit_rate_that_somebody_says(
    tmp_path: Path, master: str, options: str, late: bool, unknown: bool
) -> None:
    with Bench(()) as bench:
        rules = said(bench, f"check {busy(tmp_path, master)} {options}")
    assert bool(rules.keys() & {"too-late", "bus-overload"}) is late
    assert ("unknown-bit-rate" in rules, rules.get("unknown-bit-rate", "note")) == (unknown, "note")


@pytest.mark.parametrize(("master", "rate", "assumed"), [
    ("master: {baudrate: 250}", 250_000, False), ("", 500_000, True),
])  # fmt: skip
def test_a_load_is_that_of_the_files_bit_rate_or_says_that_it_is_assumed(
    tmp_path: Path, master: str, rate: int, assumed: bool
) -> None:
    with Bench(()) as bench:
        document = bench.run(f"load {busy(tmp_path, master)} --json").document
    assert (document["bit_rate"], document["bit_rate_assumed"]) == (rate, assumed)


def _without_defaults(eds: Eds) -> None:
    for index, _ in USUAL:
        eds.variable(index, var("COB-ID of a service", U32))


def _without_type(eds: Eds) -> None:
    subs = communication("$NODEID+0x180")
    del subs[2]["DefaultValue"]
    eds.record(0x1800, "Communication 1", subs)


def _without_cob_id(eds: Eds) -> None:
    subs = communication("$NODEID+0x180")
    del subs[1]["DefaultValue"]
    eds.record(0x1800, "Communication 1", subs)


@pytest.mark.parametrize("lacking", [_without_defaults, _without_type, _without_cob_id])
def test_a_default_that_a_file_does_not_tell_is_no_error(tmp_path: Path, lacking: Callable[[Eds], None]) -> None:
    eds = plain()
    lacking(eds)
    (tmp_path / "io.eds").write_text(eds.text(), "latin-1")
    file = tmp_path / "net.yml"
    rows = [f"n{node_id}: {{node_id: {node_id}, dcf: io.eds, heartbeat_producer: 500}}" for node_id in (5, 6)]
    file.write_text("\n".join(rows), "utf-8")
    with Bench(()) as bench:
        rules = said(bench, f"check {file} --at 125000")
    assert "error" not in rules.values()
    assert not {name for name in rules if "sync" in name}


@pytest.mark.parametrize(("place", "value"), USUAL.items())
def test_a_simulated_node_has_the_standards_default(tmp_path: Path, place: tuple[int, int], value: int) -> None:
    eds = plain()
    _without_defaults(eds)
    path = tmp_path / "io.eds"
    path.write_text(eds.text(), "latin-1")
    with Bench((f"{path}@5",)) as bench:
        assert bench.run(f"read {place[0]:04X} --json").document["value"] == value
