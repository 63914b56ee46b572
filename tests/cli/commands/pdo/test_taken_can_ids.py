"""Further SDO channels take their CAN-IDs everywhere, and a PDO never gets another CAN-ID silently."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench
from tests.small_eds import U32, Eds, plain, var

#: of node 5: an SDO server and a client, 11 and 29 bits, and a channel that is off by one of its COB-IDs
CHANNELS = {
    0x1201: (0x6A0, 0x6A1),
    0x1202: (0x2000_0000 | 0x1_2345, 0x2000_0000 | 0x1_2346),
    0x1280: (0x6B0, 0x6B1),
    0x1281: (0x6C0, 0x8000_06C1),
}
TAKEN = ["0x6A0", "0x6A1", "0x12345 --extended", "0x12346 --extended", "0x6B0", "0x6B1"]
FREE = ["0x6C0", "0x6C1", "0x6A0 --extended", "0x6A2"]


def with_channels(channels: dict[int, tuple[int, int]]) -> Eds:
    eds = plain()
    for index, words in channels.items():
        eds.record(index, "SDO channel", {n: var(f"COB-ID {n}", U32, word) for n, word in enumerate(words, 1)})
    return eds


@pytest.fixture
def served(tmp_path: Path) -> Path:
    path = tmp_path / "sdo.eds"
    path.write_text(with_channels(CHANNELS).text(), "latin-1")
    (tmp_path / "io.eds").write_text(plain().text(), "latin-1")
    return path


def clash_of(bench: Bench, line: str) -> tuple[int, bool]:
    """The exit code, and whether an SDO channel is why."""
    ran = bench.run(f"{line} --json")
    return ran.code, "an SDO " in ran.stdout


@pytest.mark.parametrize("node", [5, 6])
@pytest.mark.parametrize("pdo", ["tpdo2", "rpdo2"])
@pytest.mark.parametrize("verb", ["map", "set"])
def test_an_sdo_channel_is_taken_on_its_node_and_on_others(served: Path, node: int, pdo: str, verb: str) -> None:
    what = ("6000:2" if pdo == "tpdo2" else "6200:2") if verb == "map" else ""
    with Bench((f"{served}@5", f"{served.parent / 'io.eds'}@6")) as bench:
        assert bench.run("pdo 5:tpdo1").code == 0
        assert bench.run(f"map {node}:{pdo} {'6000:2' if pdo == 'tpdo2' else '6200:2'}").code == 0
        for words in TAKEN:
            assert clash_of(bench, f"{verb} {node}:{pdo} {what} --cob-id {words}") == (1, True), words
            assert clash_of(bench, f"{verb} {node}:{pdo} {what} --cob-id {words} --force")[0] == 0, words
        for words in FREE:
            assert clash_of(bench, f"{verb} {node}:{pdo} {what} --cob-id {words}") == (0, False), words


def test_a_free_can_id_is_none_of_an_sdo_channel(tmp_path: Path) -> None:
    path = tmp_path / "sdo.eds"
    path.write_text(with_channels({0x1201: (0x680, 0x681), 0x1280: (0x682, 0x683)}).text(), "latin-1")
    with Bench((f"{path}@5",)) as bench:
        assert bench.run("set rpdo1 --cob-id 0x285").code == 0
        assert bench.run("map tpdo2 6000:2 --cob-id auto").code == 0
        assert bench.session.node(5).wanted
        held = {str(pdo): config.communication.cob_id.can_id for pdo, config in bench.session.node(5).pdos().items()}
    assert held["tpdo2"] == 0x684


@pytest.mark.parametrize("words", TAKEN)
def test_check_finds_it_in_a_file_and_on_a_bus(served: Path, words: str) -> None:
    can_id, _, extended = words.partition(" ")
    file = served.parent / "net.yml"
    cob_id = f"0x{int(can_id, 16) | (1 << 29 if extended else 0):X}"
    file.write_text(
        f"a: {{node_id: 5, dcf: sdo.eds}}\n"
        f"b: {{node_id: 6, dcf: io.eds, tpdo: {{2: {{cob_id: {cob_id}, enabled: true, mapping: [0x6000:2]}}}}}}\n"
    )
    with Bench(()) as bench:
        ran = bench.run(f"check {file} --json")
    found = [one for one in ran.document["files"][0]["findings"] if one["rule"] == "can-id-of-sdo"]
    assert (ran.code, [one["node"] for one in found]) == (4, [6])
    with Bench((f"{served}@5", f"{served.parent / 'io.eds'}@6")) as bench:
        assert bench.run(f"map 6:tpdo2 6000:2 --cob-id {words} --force").code == 0
        ran = bench.run("check --live --json")
    assert "can-id-of-sdo" in [one["rule"] for one in ran.document["files"][0]["findings"]]


def test_another_can_id_is_taken_aloud(tmp_path: Path) -> None:
    path = tmp_path / "io.eds"
    path.write_text(plain().text(), "latin-1")
    with Bench((f"{path}@5",)) as bench:
        assert bench.run("disable tpdo1").code == 0
        assert bench.run("set rpdo1 --cob-id 0x185").code == 0
        for line in ("map tpdo1 6000:2", "map tpdo1 6000:2 --cob-id auto"):
            ran = bench.run(f"{line} --json")
            (said,) = [one for one in ran.document["findings"] if one["rule"] == "can-id-instead"]
            assert (ran.code, said["severity"]) == (0, "note")
            assert "0x185 is already used by RPDO1 of this node: 0x680 instead" in said["text"]
            assert said["hint"] == "--cob-id 0x185 --force accepts it nevertheless"
            assert bench.run("disable tpdo1").code == 0
            assert bench.run("set tpdo1 --cob-id 0x185").code == 0
        assert "can-id-instead" not in bench.run("map tpdo1 6000:2 --cob-id 0x690 --json").stdout
        assert "can-id-instead" not in bench.run("map tpdo2 6000:2 --json").stdout


def test_an_emcy_that_is_off_takes_nothing(tmp_path: Path) -> None:
    eds = plain()
    eds.variable(0x1014, var("COB-ID EMCY", U32, 0x8000_06A0))
    path = tmp_path / "io.eds"
    path.write_text(eds.text(), "latin-1")
    with Bench((f"{path}@5",)) as bench:
        assert bench.run("map tpdo2 6000:2 --cob-id 0x6A0").code == 0
        assert bench.run("write 1014 0x6A0").code in {0, 1}


@pytest.mark.parametrize("line", ["enable tpdo2", "write 1801:1 0x185"])
def test_the_free_can_id_that_a_refusal_hints_at_is_taken_by_what_is_typed_then(tmp_path: Path, line: str) -> None:
    path = tmp_path / "io.eds"
    path.write_text(plain().text(), "latin-1")
    with Bench((f"{path}@5",)) as bench:
        assert bench.run("map tpdo1 6000:1 --cob-id 0x185").code == 0
        assert bench.run("map tpdo2 6000:2 --off --cob-id 0x185").code == 0
        ran = bench.run(line)
        assert ran.code == 1, ran
        _, *commands = re.findall("`([^`]+)`", ran.stderr.partition("hint")[2].partition("\n")[0])
        words = [command.split("@5 ")[-1] for command in commands]
        assert words == ["set tpdo2 --cob-id auto", *(["enable tpdo2"] if line.startswith("enable") else [])]
        assert [bench.run(typed).code for typed in words] == [0] * len(words)
