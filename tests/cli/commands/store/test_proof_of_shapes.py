"""`store --prove` on devices of many shapes: proved only where what was in RAM only is gone, and all else is equal."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from dvtcli.domain.ports import Frame
from tests.cli.commands.bench import Bench
from tests.small_eds import U8, U16, U32, Eds, communication, mapping, plain, var

#: of 0x1017: absent, or its access and default
HEARTBEATS = (None, ("rw", 0), ("rw", 1), ("rw", 1000), ("const", 1000))
#: the access of COB-IDs, and whether PDOs have timers
PDOS = (("rw", True), ("rw", False), ("const", True), ("const", False))
#: what a device comes up with: all PDOs enabled, or the second ones off and empty
ON = (True, False)
GUARDED = (True, False)
FAULTS = ("", "stores-nothing", "keeps-ram", "saves-itself")
SHAPES = list(itertools.product(HEARTBEATS, PDOS, ON, GUARDED, FAULTS))


def made(heartbeat: tuple[str, int] | None, pdos: tuple[str, bool], all_on: bool, guarded: bool) -> Eds:
    """A device of that shape."""
    eds, (access, has_timers) = plain(), pdos
    del eds.objects[0x1017]
    if heartbeat is not None:
        eds.variable(0x1017, var("Heartbeat time", U16, heartbeat[1], heartbeat[0]))
    if guarded:
        eds.variable(0x100C, var("Guard time", U16, 100))
        eds.variable(0x100D, var("Life time factor", U8, 3))
    for base, default, target in ((0x1400, 0x200, 0x6200), (0x1800, 0x180, 0x6000)):
        for number in (0, 1):
            word = f"$NODEID+0x{default + 0x100 * number + (0 if all_on or not number else 0x80000000):X}"
            subs = communication(word)
            subs[1] = var("COB-ID", U32, word, access)
            if not has_timers:
                subs = {1: subs[1], 2: subs[2]}
            eds.record(base + number, f"Communication {number + 1}", subs)
            first = [target << 16 | 0x0108 + 0x100 * number] if all_on or not number else []
            eds.record(base + number + 0x200, f"Mapping {number + 1}", mapping(len(first), [*first, *[0] * 3]))
    return eds


def held(bench: Bench) -> tuple[object, object]:
    """What the node holds of its PDOs, and its heartbeat time."""
    document = bench.run("pdo --all --json").document
    return document["pdos"], bench.run("read 1017 --json").stdout


@pytest.mark.drawn(16)
@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_proved_only_where_what_was_in_ram_only_is_gone_and_all_else_is_equal(
    tmp_path: Path, shape: tuple[tuple[str, int] | None, tuple[str, bool], bool, bool, str]
) -> None:
    *parts, fault = shape
    path = tmp_path / "shape.eds"
    path.write_text(made(*parts).text(), "utf-8")
    with Bench((str(path),), {"yes": True, "fault": (fault,) if fault else ()}) as bench:
        assert bench.run("set tpdo1 --sync 3").code == 0
        before, saves = held(bench), list[bytes]()

        def note(frame: Frame, ours: bool) -> None:
            if ours and bytes(frame.data[4:]) == b"save":
                saves.append(bytes(frame.data))

        untap = bench.session.open_network().bus.tap(note)
        ran = bench.run("store --prove --json")
        untap()
        document = ran.answer
        if not saves:
            assert (ran.code, document["state"]) == (1, "unchanged"), ran
            assert "could not be proved" in document["text"]
            assert "store --prove power" in document["hint"]
            assert held(bench) == before, "what was tried is rolled back"
            return
        if fault == "stores-nothing":
            assert (ran.code, document["proved"]) == (1, False)
            assert held(bench) != before
            return
        assert held(bench) == before
        assert document["canary"], "without one nothing is stored"
        assert (ran.code, document["proved"]) == ((0, True) if not fault else (1, False)), ran


@pytest.mark.parametrize("heartbeat", HEARTBEATS)
@pytest.mark.parametrize("all_on", ON)
def test_a_device_whose_cob_ids_may_be_written_is_always_proved(
    tmp_path: Path, heartbeat: tuple[str, int] | None, all_on: bool
) -> None:
    """Also OPERATIONAL, without timers and heartbeat: a PDO is taken off in PRE-OPERATIONAL, and the node started."""
    path = tmp_path / "shape.eds"
    path.write_text(made(heartbeat, ("rw", False), all_on, guarded=True).text(), "utf-8")
    for line in ("nmt preop", "nmt start"):
        with Bench((str(path),), {"yes": True}) as bench:
            assert bench.run(line).code == 0
            state = bench.session.node().access.state()
            ran = bench.script("store --prove")
            assert ran.code == 0, ran
            assert state is None or bench.session.node().access.state() is state, "a heartbeat tells its state"


def test_a_pdo_that_was_taken_off_for_the_test_is_put_back_where_ram_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "shape.eds"
    path.write_text(made(None, ("rw", False), True, guarded=False).text(), "utf-8")
    with Bench((str(path),), {"yes": True, "fault": ("keeps-ram",)}) as bench:
        before = held(bench)
        ran = bench.run("store --prove")
        assert ran.code == 1
        assert "0x1800:01 (COB-ID of TPDO1) 0x181 enabled -> 0x181 off" in ran.stdout
        assert "0x1800:01 (COB-ID of TPDO1) is rolled back to 0x181 enabled, read back equal" in ran.stderr
        assert held(bench) == before


def test_a_master_that_obeys_no_reset_is_not_told_to_store() -> None:
    with Bench(("gen4",), {"yes": True}) as bench:
        bench.run("login 4")
        assert bench.run("write 5800 1 --force").code == 0
        for line, hint in (("store --prove", "store --prove power"), ("restore --prove", "switch the node off and on")):
            ran = bench.run(line)
            assert (ran.code, ran.stdout) == (1, ""), ran
            assert "node 1 ignores the NMT reset: nothing was stored or restored" in ran.stderr
            assert "0x5800:00 makes it an NMT master" in ran.stderr
            assert hint in ran.stderr


def test_a_network_with_a_node_that_cannot_be_proved_is_not_written(tmp_path: Path) -> None:
    file = tmp_path / "two.yaml"
    nodes = "".join(f"  n{one}: {{node_id: {one}, heartbeat_producer: 700, store: true}}\n" for one in (1, 2))
    file.write_text(f"nodes:\n{nodes}", "utf-8")
    with Bench(("generic", "gen4"), {"yes": True}) as bench:
        bench.run("node 2")
        bench.run("login 4")
        assert bench.run("write 5800 1 --force").code == 0
        before = [bench.run(f"read {one}:1017").stdout for one in (1, 2)]
        ran = bench.run(f"apply {file} --prove")
        assert ran.code == 1, ran
        assert "node 2 ignores the NMT reset" in ran.stderr
        assert [bench.run(f"read {one}:1017").stdout for one in (1, 2)] == before
