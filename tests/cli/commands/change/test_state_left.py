"""Rules of networks hold for every command that changes a PDO: what counts is the state that it would leave."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench, Ran
from tests.small_eds import U32, Eds, plain, var

#: what a PDO of node 5 may not be sent with beside node 9, by what takes it
TAKEN = {
    "TPDO of another node": 0x189,
    "TPDO of the node": 0x185,
    "SYNC": 0x080,
    "EMCY of the node": 0x6A5,
    "EMCY of another node": 0x6A9,
    "time stamp of another node": 0x6B9,
    "SDO channel of another node": 0x6C9,
}
FREE = 0x690
#: ways to a COB-ID that is another one, and ways that leave it as it is
MOVES = ("set", "map", "enable", "write", "network file", "saved plan", "DCF", "backup", "clone")
STAYS = ("set", "map", "write", "network file", "saved plan", "DCF", "backup", "clone")


def devices(folder: Path) -> tuple[str, str]:
    """Nodes 5 and 9; the second one sends the time stamp and has a second SDO server."""
    for node_id in (5, 9):
        eds = described()
        if node_id == 9:
            eds.variable(0x1012, var("COB-ID TIME", U32, 0x4000_06B9))
            eds.record(0x1201, "SDO server", {1: var("COB-ID 1", U32, 0x6C9), 2: var("COB-ID 2", U32, 0x6CA)})
        (folder / f"{node_id}.eds").write_text(eds.text(), "latin-1")
    return f"{folder / '5.eds'}@5", f"{folder / '9.eds'}@9"


def described() -> Eds:
    eds = plain()
    eds.info = {"VendorNumber": 0x71, "ProductNumber": 0x72, "RevisionNumber": 0x73}
    eds.record(0x1018, "Identity", {n: var(f"Part {n}", U32, 0x70 + n, "ro") for n in range(1, 5)})
    eds.variable(0x1005, var("COB-ID SYNC", U32, 0x80))
    eds.variable(0x1014, var("COB-ID EMCY", U32, "$NODEID+0x6A0"))
    return eds


def with_both(folder: Path) -> Bench:
    """A session with both nodes."""
    bench = Bench(devices(folder), {"node": 5, "yes": True})
    done(bench, "read 9:1000", "map tpdo2 6000:2 --cob-id 0x691")
    return bench


def done(bench: Bench, *lines: str) -> None:
    for line in lines:
        ran = bench.run(line)
        assert ran.code == 0, (line, ran)


def file_of(folder: Path, suffix: str, node_id: int, *lines: str) -> Path:
    """A file about a device like node 5, but with *node_id*, that *lines* set up."""
    path = folder / f"wanted{suffix}"
    with Bench((f"{folder / '5.eds'}@{node_id}",), {"yes": True}) as bench:
        done(bench, *lines, f"{'export' if suffix == '.dcf' else 'backup'} {path}")
    return path


def network_file(folder: Path, keys: str) -> Path:
    path = folder / "net.yml"
    path.write_text(f"a: {{node_id: 5, dcf: 5.eds, tpdo: {{2: {{{keys}}}}}}}\n", "utf-8")
    return path


def way(bench: Bench, how: str, folder: Path, can_id: int, *, moves: bool) -> str:
    """Prepare *how* TPDO2 of node 5 is sent with *can_id*, or goes on to be if nothing *moves*; the line that does."""
    cob_id = f"0x{can_id:03X}"
    if not moves:
        done(bench, f"set tpdo2 --cob-id {cob_id} --force")
    elif how in {"enable", "write"}:
        done(bench, "disable tpdo2", *([f"set tpdo2 --cob-id {cob_id} --force"] if how == "enable" else []))
    of_device = f"map tpdo2 6000:2 --cob-id {cob_id} --timer 50 --force"
    in_network = f"cob_id: {cob_id}, event_timer: 50, enabled: true" if moves else "event_timer: 50"
    match how:
        case "set":
            return f"set tpdo2 --cob-id {cob_id}" if moves else "set tpdo2 --timer 50"
        case "map":
            return f"map tpdo2 6000:2 6000:3{f' --cob-id {cob_id}' if moves else ''}"
        case "enable":
            return "enable tpdo2"
        case "write":
            return f"write 1801:1 {cob_id}" if moves else "write 1801:5 50"
        case "network file":
            return f"apply {network_file(folder, in_network)}"
        case "saved plan":
            done(bench, f"plan {network_file(folder, in_network)} -o {folder / 'plan.json'} --force")
            return f"apply {folder / 'plan.json'}"
        case "clone":
            return f"clone {file_of(folder, '.dcf', 7, of_device)}"
        case _:
            return f"apply {file_of(folder, '.dcf' if how == 'DCF' else '.jsonl', 5, of_device)}"


def refused(bench: Bench, line: str) -> Ran:
    held = bench.session.node(5).pdos()
    ran = bench.run(f"{line} --json")
    assert ran.code == 1, (line, ran)
    assert ran.document["error"] == "rules"
    assert bench.session.node(5).pdos() == held
    return ran


@pytest.mark.drawn(12)
@pytest.mark.parametrize("what", TAKEN)
@pytest.mark.parametrize("how", MOVES)
def test_no_command_gives_a_pdo_a_can_id_that_is_taken(how: str, what: str, tmp_path: Path) -> None:
    with with_both(tmp_path) as bench:
        line = way(bench, how, tmp_path, TAKEN[what], moves=True)
        refused(bench, line)
        done(bench, f"{line} --force")


@pytest.mark.drawn(12)
@pytest.mark.parametrize("what", TAKEN)
@pytest.mark.parametrize("how", STAYS)
def test_no_command_leaves_a_can_id_that_is_taken_to_a_pdo_that_it_changes(how: str, what: str, tmp_path: Path) -> None:
    with with_both(tmp_path) as bench:
        line = way(bench, how, tmp_path, TAKEN[what], moves=False)
        refused(bench, line)
        done(bench, f"{line} --force")


@pytest.mark.drawn(5)
@pytest.mark.parametrize("moves", [True, False])
@pytest.mark.parametrize("how", MOVES)
def test_a_can_id_that_is_free_is_let_through(how: str, moves: bool, tmp_path: Path) -> None:
    with with_both(tmp_path) as bench:
        done(bench, way(bench, how, tmp_path, FREE, moves=moves))


#: services of node 9 that a write may give a CAN-ID: the object, its flags, and who else may have that CAN-ID
SERVICES = {
    "1005": (0, {"SYNC", "SYNC of another node"}),
    "1012": (1 << 30, set()),
    "1014": (0, set()),
    "1201:1": (0, {"SDO channel"}),
}
#: what has a CAN-ID besides the service that is written
OTHERS = {
    "SYNC": 0x080,
    "SYNC of another node": 0x082,
    "EMCY of another node": 0x6A5,
    "SDO channel": 0x6CA,
    "TPDO of the node": 0x189,
    "RPDO of the node": 0x209,
    "TPDO of another node": 0x185,
    "RPDO of another node": 0x205,
}


@pytest.mark.drawn(8)
@pytest.mark.parametrize("what", [*OTHERS, "PDO that is off", "itself"])
@pytest.mark.parametrize("service", SERVICES)
def test_no_write_gives_a_service_a_can_id_that_is_taken(service: str, what: str, tmp_path: Path) -> None:
    flags, shares = SERVICES[service]
    with with_both(tmp_path) as bench:
        done(bench, "write 1005 0x82", "enable 9:rpdo1", "enable 5:rpdo1", "disable 9:tpdo2", f"read 9:{service}")
        held = held_at(bench, service)
        raw = held if what == "itself" else flags | {**OTHERS, "PDO that is off": 0x289}[what]
        ran = bench.run(f"write 9:{service} 0x{raw:X} --json")
        if what in {*shares, "PDO that is off", "itself"}:
            assert ran.code == 0, ran
            return
        assert (ran.code, ran.document["error"]) == (1, "rules"), ran
        assert [one["rule"] for one in ran.document["findings"]] == ["can-id-in-use"]
        assert held_at(bench, service) == held


def held_at(bench: Bench, service: str) -> int:
    index, _, sub_index = service.partition(":")
    return int.from_bytes(bench.session.node(9).upload(int(index, 16), int(sub_index or "0")), "little")


@pytest.mark.parametrize("line", ["map tpdo2 6000:2 6000:3", "map tpdo2 6000:2 6000:3 --off", "set tpdo2 --timer 50",
                                  "enable tpdo2"])  # fmt: skip
@pytest.mark.parametrize("base", [0x280, 0x200, 0x480])
def test_a_base_of_the_pre_defined_set_is_told_with_the_own_default(base: int, line: str, tmp_path: Path) -> None:
    with with_both(tmp_path) as bench:
        done(bench, f"set tpdo2 --cob-id 0x{base:X}")
        if line.startswith("enable"):
            done(bench, "disable tpdo2")
        ran = bench.run(f"{line} --json")
        (said,) = [one for one in ran.document["findings"] if one["rule"] == "base-cob-id"]
        assert (ran.code, said["severity"], "--cob-id 0x285" in said["hint"]) == (0, "warning", True)
        assert "this node's own default is 0x285" in said["text"]
        assert "base-cob-id" not in bench.run("map tpdo2 6000:2 --cob-id auto --json").stdout
        file = network_file(tmp_path, f"cob_id: 0x{base:X}, enabled: true")
        assert "base-cob-id" in bench.run(f"apply {file} --json").stdout


@pytest.mark.parametrize("mine", ["tpdo2", "rpdo2"])
def test_another_length_than_the_other_end_is_told(mine: str, tmp_path: Path) -> None:
    objects, other, theirs = ("6000", "rpdo2", "6200") if mine == "tpdo2" else ("6200", "tpdo2", "6000")
    with with_both(tmp_path) as bench:
        done(bench, "disable tpdo2", f"map 9:{other} {theirs}:1 {theirs}:2 --cob-id 0x695")
        for count, words in ((1, "0x8210" if mine == "tpdo2" else "0x8220"), (2, ""), (3, "0x8220")):
            mapped = " ".join(f"{objects}:{number + 1}" for number in range(count))
            ran = bench.run(f"map {mine} {mapped} --cob-id 0x695 --json")
            said = [one["text"] for one in ran.document["findings"] if one["rule"] == "consumer-length"]
            assert (ran.code, len(said)) == (0, bool(words)), ran
            assert all("of node 9" in text for text in said)
        assert "consumer-length" not in bench.run(f"set {mine} --timer 77 --json").stdout
