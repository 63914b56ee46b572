"""A dry run reads the node and writes to its twin: every frame on the bus is looked at."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.nmt import NmtState
from dvtcli.simulator.network.family_file import family_eds
from tests.cli.commands.bench import Bench, Ran
from tests.cli.commands.bus import Wire, device
from tests.harness.sample import heavy

SCRIPT = [
    "map tpdo1 606C 6041 --cob-id auto --sync 1",
    "map rpdo1 dummy/16 6040 --cob-id 0x3A1",
    "set tpdo2 --timer 100",
    "set tpdo1 --cob-id 0x3A0",
    "write 1017 1000",
    "write 1800:5 20",
    "disable tpdo2",
    "enable tpdo2",
    "clear rpdo2",
    "store",
    "nmt start",
    "sync",
    "sync --count 3 --period 1",
    "nmt preop",
    "verify tpdo1 --frame",
    "nmt reset-comm",
    "verify tpdo1",
    "store --prove",
    "undo",
    "undo --all",
    "restore",
    "nmt reset-node all",
    "nmt stop",
    "nmt preop",
    "node",
    "pdo",
]


def told_nodes(wire: Wire) -> list[str]:
    """Every frame but the node's own (TPDOs, SDO answers, boot-ups and heartbeats) and requests that only read."""
    own = (0x180, 0x280, 0x380, 0x480, 0x580, 0x700)
    ours = [m for m in wire.frames() if m.arbitration_id & 0x780 not in own]
    # SDO client command specifiers: 2 initiate upload, 3 upload segment, 4 abort
    return [str(m) for m in ours if not (0x601 <= m.arbitration_id <= 0x67F and m.data[0] >> 5 in (2, 3, 4))]


@pytest.mark.drawn(5)
@pytest.mark.parametrize("family", ["generic", "gen4", "tmcm"])
@pytest.mark.parametrize("state", [NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL])
@pytest.mark.parametrize("described", [True, False])
def test_only_uploads_reach_the_bus(family: str, state: NmtState, described: bool) -> None:
    node = device(family)
    with Wire(node) as wire:
        options = {**wire.options, "dry_run": True, "yes": True, "timeout": 0.2}
        if described:
            options["eds"] = str(family_eds(family))
        with Bench((), options) as bench:
            node.state = state
            wire.frames()
            bench.script(*SCRIPT, keep_going=True)
            assert told_nodes(wire) == []
            assert node.state is state


@heavy
def test_the_commands_of_the_script_do_something() -> None:
    """Else the law above would hold for nothing: on a CiA 301 drive all of them succeed."""
    with Wire(device("generic")) as wire:
        options = {**wire.options, "dry_run": True, "yes": True, "eds": str(family_eds("generic"))}
        with Bench((), options) as bench:
            for line in SCRIPT:
                ran = bench.run(line)
                assert ran.code in (0, 3), f"{line}: {ran.stderr}"


SAME = [
    "map tpdo1 606C 6041 --cob-id auto --sync 1 --inhibit 2",
    "map tpdo1 1018:1",
    "map tpdo1 6041 --force --cob-id 0x701",
    "map rpdo1 dummy/16 6040 --cob-id 0x3A1",
    "map tpdo2 606C 606C 6041",
    "map tpdo2 606C/16 --force",
    "map tpdo2 5FFF:0/16 --force",
    "set tpdo2 --timer 100",
    "set tpdo1 --type 245 --force",
    "write 1017 1000",
    "write 6041 3 --force",
    "write 1A00:1 0x60410010 --force",
    "disable tpdo2",
    "verify",
    "store",
    "clear tpdo2",
    "store 9",
    "write 1010:1 1",
    "undo",
    "nmt reset-node",
    "verify tpdo1",
    "pdo --all",
    "undo --all",
    "pdo --all",
]


def told(ran: Ran) -> list[dict[str, object]]:
    """The documents without what a clock or the dry run itself changes."""
    changing = ("dry_run", "seconds", "stored", "ms", "state", "stays", "stays_differing", "message")
    return [{key: value for key, value in document.items() if key not in changing} for document in ran.documents]


def states(ran: Ran) -> set[object]:
    """In which states errors say that the device is."""
    return {document["state"] for document in ran.documents if document["schema"] == "dvtcli.error/1"}


@pytest.mark.drawn(2)
@pytest.mark.parametrize("family", ["generic", "gen4", "tmcm", "roboteq"])
def test_a_dry_run_says_what_the_real_run_says(family: str) -> None:
    with Bench((family,), {"yes": True, "format": "json", "dry_run": True}) as dry:
        rehearsed = dry.script(*SAME, keep_going=True)
    with Bench((family,), {"yes": True, "format": "json"}) as bench:
        real = bench.script(*SAME, keep_going=True)
    assert len([one for one in real.documents if one.get("exit_code") != 3]) == len(SAME)  # differences say so as well
    for a, b in zip(told(rehearsed), told(real), strict=True):
        assert a == b
    assert rehearsed.code == real.code
    assert states(rehearsed) <= {"unchanged"}, "whatever the twin refused, the node was never written to"
    changed = [document for document in rehearsed.documents if "dry_run" in document]
    assert changed
    assert all(document["dry_run"] for document in changed)
    assert not any(document.get("dry_run") for document in real.documents)


def test_save_in_a_dry_run_writes_no_file(tmp_path: Path) -> None:
    with Bench(("generic",), {"dry_run": True}) as bench:
        ran = bench.script("map tpdo1 606C", f"save {tmp_path / 'x.dvt'}")
        assert ran.code == 2
        assert "nothing to save" in ran.stderr
        assert list(tmp_path.iterdir()) == []


def test_each_dry_line_has_a_twin_of_its_own_and_a_dry_script_one_for_all_its_lines() -> None:
    line = "set tpdo1 --timer 70"
    with Bench(("gen4",)) as bench:
        for _ in range(2):
            assert bench.run(f"{line} --dry-run --json").document["writes"] == 1, "no line knows of one before it"
        assert bench.run(f"{line} --json").document["writes"] == 1
    with Bench(("gen4",), {"dry_run": True}) as bench:
        writes = [document["writes"] for document in bench.script(f"{line} --json", f"{line} --json").documents]
        assert writes == [1, 0]


@pytest.mark.parametrize("line", ["write 2004 5", "write 2004 0"])
def test_a_write_only_object_is_written_to_the_twin_as_to_the_node(line: str) -> None:
    """The twin asked the node what it held, which is what a write-only object does not tell."""
    answers = []
    for dry in (True, False):
        with Bench(("generic@5",), {"yes": True, "dry_run": dry}) as bench:
            answers.append(bench.run(line))
    assert [ran.code for ran in answers] == [0, 0], answers
