"""PDOs that a network file does not say the mapping of: read by their file's default, and never without a word."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from dvtcli.domain.network.network_config import NetworkConfig
from dvtcli.domain.network.network_state import NetworkState
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.ports import Frame
from dvtcli.errors import DvtcliError
from dvtcli.operations.frames.layouts import file_layouts
from dvtcli.operations.network.described_network import described_network, described_pdos
from dvtcli.operations.plans.read_network_config import read_network_config
from dvtcli.operations.user.session_user import NullReporter
from dvtcli.simulator.network.family_file import family_eds, family_names
from dvtcli.watch.decoder import Decoder
from dvtcli.watch.seen import FrameStore
from tests.cli.commands.bench import Bench
from tests.cli.commands.frames.test_misfits import log, warnings
from tests.process import environment, run

FILE = "drive: {node_id: 1, profile: gen4, tpdo: {1: {inhibit_ms: 10}, 2: {mapping: [606C, 6041]}}}\n"
UNSAID, SAID = "181#3712", "281#010203043712"
SENTENCE = (
    "0x181: line.yaml does not say what TPDO1 of node 1 maps: read by the default mapping of the family gen4, "
    "which the node need not hold"
)


@pytest.fixture
def line(tmp_path: Path) -> Path:
    path = tmp_path / "line.yaml"
    path.write_text(FILE)
    return path


@pytest.mark.parametrize(
    "words", ["decode {} -d {}", "decode {} --json -d {}", "decode {} --csv -d {}", "plot {} Statusword -d {}"]
)
def test_a_mapping_that_the_file_does_not_say_is_told_once(tmp_path: Path, line: Path, words: str) -> None:
    path = log(tmp_path, UNSAID, SAID, UNSAID, SAID)
    with Bench(()) as bench:
        ran = bench.run(words.format(path, line))
    assert (ran.code, warnings(ran.stderr)) == (0, [f"warning: {SENTENCE}"])


def test_a_document_says_who_says_where_its_values_lie(tmp_path: Path, line: Path) -> None:
    with Bench(()) as bench:
        ran = bench.run(f"decode {log(tmp_path, UNSAID, SAID, '7A0#10')} -d {line} --json")
    found = [json.loads(one) for one in ran.stdout.splitlines()]
    assert [(one["layout_from"], one["layout_is_guess"]) for one in found] == [
        ("the default mapping of the family gen4", True),
        ("the mapping in line.yaml", False),
        (None, False),
    ]


def test_one_frame_says_it_too(line: Path) -> None:
    for frame, said in ((UNSAID, [f"warning: {SENTENCE}"]), (SAID, [])):
        with Bench(()) as bench:
            assert warnings(bench.run(f"explain {frame} -d {line}").stderr) == said


def test_what_a_node_holds_goes_before_a_default(line: Path) -> None:
    with Bench(("gen4",)) as bench:
        ran = bench.run(f"send --dry-run {UNSAID} -d {line}")
    assert (ran.code, warnings(ran.stderr), "Statusword" in ran.stdout or "6041" in ran.stderr) == (0, [], True)


def test_the_monitor_has_an_event_for_it(line: Path) -> None:
    store, late = FrameStore(decoder := Decoder(file_layouts(str(line), NullReporter()))), FrameStore(Decoder())
    for one in (store, late):
        for frame in (Frame(0x181, b"7\x12"), Frame(0x281, bytes(6)), Frame(0x181, b"7\x12")):
            one.take(frame)
    late.know(decoder)
    assert [[event.text for event in one.events] for one in (store, late)] == [[SENTENCE], [SENTENCE]]


def test_a_value_in_a_dcf_is_said(tmp_path: Path) -> None:
    """What this very node maps stands in its file: that is no default."""
    with Bench(("gen4",)) as bench:
        assert bench.run(f"export {tmp_path / 'drive.dcf'}").code == 0
    (tmp_path / "line.yaml").write_text("drive: {node_id: 1, dcf: drive.dcf}\n")
    with Bench(()) as bench:
        ran = bench.run(f"decode {log(tmp_path, UNSAID)} -d {tmp_path / 'line.yaml'}")
    assert (warnings(ran.stderr), "Statusword" in ran.stdout) == ([], True)


def test_what_the_file_says_goes_before_a_default(tmp_path: Path) -> None:
    """Node 1's default TPDO1 has CAN-ID 0x181, which the file gives to node 5."""
    eds = family_eds("gen4")
    (tmp_path / "line.yaml").write_text(
        f"a: {{node_id: 1, dcf: {eds}}}\n"
        f"b: {{node_id: 5, dcf: {eds}, tpdo: {{1: {{cob_id: 0x181, mapping: [606C]}}}}}}\n"
    )
    with Bench(()) as bench:
        ran = bench.run(f"decode {log(tmp_path, '181#01000000')} -d {tmp_path / 'line.yaml'}")
    assert ("TPDO1 node 5" in ran.stdout, warnings(ran.stderr)) == (True, [])


def test_a_dbc_file_of_a_network_file_says_it_and_has_it(tmp_path: Path, line: Path) -> None:
    with Bench((), {"yes": True}) as bench:
        ran = bench.run(f"eds convert {line} {tmp_path / 'line.dbc'}")
    (said,) = warnings(ran.stderr)
    assert (
        "line.yaml does not describe what TPDO1, RPDO2 of node 1 map: taken from the default mapping of the family gen4"
        in said
    )
    comments = [one for one in (tmp_path / "line.dbc").read_text("cp1252").splitlines() if one.startswith("CM_ BO_")]
    assert comments[:2] == [
        'CM_ BO_ 385 "TPDO1 of node 1 (by the default mapping of the family gen4)";',
        'CM_ BO_ 641 "TPDO2 of node 1";',
    ]


@pytest.mark.parametrize("family", family_names())
def test_what_a_file_says_itself_is_laid_out_as_its_plan_would(tmp_path: Path, family: str) -> None:
    file = tmp_path / "net.yaml"
    entries = ["6041/16", "dummy8", "606C"]
    tpdos = {
        "nothing": "",
        "off": "1: {enabled: false}",
        "id": "1: {cob_id: 0x1F0}, 2: {cob_id: 0x1F1, enabled: true}",
        "mapped": f"1: {{mapping: [{', '.join(entries)}], enabled: true}}",
        "absent": "77: {enabled: false}",
        "long": "1: {mapping: [6041, 6041, 6041, 6041, 6041]}",
        "unknown": "1: {mapping: [No such name]}",
    }
    for said in tpdos.values():
        like = f"{{node_id: 5, dcf: {family}, tpdo: {{{said}}}}}"
        file.write_text(
            f"nodes: {{a: {{node_id: 3, dcf: {family}, tpdo: {{{said}}}}}, b: {{node_id: 4}}, c: {like}}}\n"
        )
        wanted_config = read_network_config(str(file))
        assert outcome(described_pdos, str(file), wanted_config) == outcome(
            described_network, str(file), wanted_config
        ), said


def test_defaults_that_follow_the_node_id_are_those_of_each_node(tmp_path: Path) -> None:
    text = family_eds("generic").read_text("utf-8")
    section = text.index("[1800sub5]")
    behind = text.index("DefaultValue=", section) + len("DefaultValue=")
    end = text.index("\n", behind)
    (tmp_path / "drive.eds").write_text(f"{text[:behind]}$NODEID+0x10{text[end:]}", "utf-8")
    file = tmp_path / "net.yaml"
    file.write_text("nodes: {a: {node_id: 3, dcf: drive.eds}, b: {node_id: 5, dcf: drive.eds}, c: {node_id: 9}}\n")
    state = described_pdos(str(file), read_network_config(str(file)))
    first, second = (node.pdos for node in state.nodes if node.pdos)
    tpdo1, tpdo2 = Pdo.parse("tpdo1"), Pdo.parse("tpdo2")
    assert [pdos[tpdo1].communication.event_timer for pdos in (first, second)] == [0x13, 0x15]
    assert [pdos[tpdo2].communication.cob_id.can_id for pdos in (first, second)] == [0x283, 0x285]
    assert first[tpdo2].mapping == second[tpdo2].mapping


def outcome(describe: Callable[..., NetworkState], file: str, wanted_config: NetworkConfig) -> object:
    """The PDOs in their order and what is guessed of each node; else the error."""
    try:
        state = describe(file, config=wanted_config)
    except DvtcliError as failed:
        return type(failed), failed.text
    layouts = [
        [(pdo, config.communication.cob_id, config.mapping, config.mpdo) for pdo, config in node.pdos.items()]
        for node in state.nodes
    ]
    return layouts, [(node.node_id, node.guessed, node.dictionary is None) for node in state.nodes]


def test_a_file_that_says_where_values_lie_is_not_planned(line: Path) -> None:
    imports = environment() | {"PYTHONPROFILEIMPORTTIME": "1"}
    ran = run(("explain", SAID, "-d", str(line)), env=imports)
    assert (ran.returncode, "plan_network" in ran.stderr) == (0, False)
    line.write_text("nodes: {a: {node_id: 1, profile: gen4, tpdo: {1: {cob_id: auto}}}}\n")
    assert "plan_network" in run(("explain", SAID, "-d", str(line)), env=imports).stderr, "a CAN-ID is chosen"
