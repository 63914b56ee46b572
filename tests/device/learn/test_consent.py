"""`learn` asks first, starts no node, and sends nothing on a dry run."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.pdo import Direction
from dvtcli.domain.ports import Frame
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import device
from tests.device.learn.cells import some
from tests.device.learn.virtual import VirtualWire, own

pytestmark = pytest.mark.drawn(6, "consent")

DOWNLOAD, NMT = range(0x20, 0x30), 0x000


def sent(frames: list[Frame]) -> list[Frame]:
    """NMT commands, SYNC and SDO downloads among *frames*."""
    return [
        frame
        for frame in frames
        if frame.can_id in (NMT, 0x080) or (frame.can_id == 0x601 and frame.data[0] in DOWNLOAD)
    ]


@pytest.mark.parametrize("state", [NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL])
def test_without_a_terminal_and_without_yes_it_is_exit_6(state: NmtState) -> None:
    node = device("generic")
    wire = VirtualWire(node)
    with wire.bench() as bench:
        bench.run("node")
        if state is NmtState.OPERATIONAL:
            bench.run("nmt start")
        wire.frames()
        ran = bench.run("learn")
        ran.failed(6, "--yes")
        assert not sent(wire.frames())
        assert node.state is state


def test_two_enabled_pdos_are_asked_about_in_the_plural() -> None:
    with own("tmcm") as bench:
        for pdo in range(1, 5):
            assert bench.run(f"map tpdo{pdo} 6041").code == bench.run(f"map rpdo{pdo} 6040").code == 0
        assert "TPDO4, RPDO4 are enabled, and off meanwhile" in " ".join(bench.run("learn").stderr.split())


def test_no_line_is_wider_than_the_screen() -> None:
    with own("tmcm") as bench:
        shown = bench.run("learn --yes --compare generic").stdout.splitlines()
    tables = [line for line in shown if line.startswith("  ")]
    assert len(tables) > 30
    assert max(map(len, tables)) <= 100


def test_a_dry_run_sends_nothing_and_shows_every_question() -> None:
    wire = VirtualWire(device("generic"))
    with wire.bench() as bench:
        bench.run("node")
        wire.frames()
        ran = bench.run("learn --dry-run --json")
        assert (ran.code, ran.document["dry_run"]) == (0, True), ran
        assert len(ran.document["probes"]) > 60
        assert not sent(wire.frames())


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    families = ("canopennode", "gen4", "lely", "tmcm")
    some(metafunc, "family,options", [(name, options) for name in families for options in ("", " --isolated")], 0.5)


@pytest.mark.counted
def test_a_dry_run_knows_how_many_writes_there_will_be(family: str, options: str) -> None:
    with own(family) as bench:
        told = bench.run(f"learn --dry-run --json{options}").document
        made = bench.run(f"learn --yes --json{options}").document["writes"]
    assert abs(made - told["likely_writes"]) <= 0.15 * made
    to_another_pdo = 20  # finding out that an entry of 0 does not go back, so that another PDO is asked
    assert made < told["writes"] <= 2.1 * made + to_another_pdo


def test_a_dry_run_is_tried_on_the_family_that_was_learnt() -> None:
    """A device that takes no transmission type 254 is like no other: its twin refuses that, too."""
    types = {Direction.TPDO: ((0, 253, 0), (254, 254, 0x06090030), (255, 255, 0))}
    odd = load_family("generic")._replace(pdo_types=types)
    node, eds = StrictDevice(read_eds(family_eds("generic")).dictionary, odd, 1), {"eds": str(family_eds("generic"))}
    wire = VirtualWire(node)
    with wire.bench(eds) as bench:
        tried = "set tpdo3 --type 254 --dry-run --force"
        assert bench.run(tried).code == 0
        assert bench.run("learn --yes --save pump").code == 0
    wire = VirtualWire(node)
    with wire.bench(eds | {"profile": "pump"}) as bench:
        ran = bench.run(tried)
        ran.failed(1, "0x06090030")


@pytest.mark.parametrize("name", [".", "..", "x/y", "/" + 300 * "a", "pump.toml", "Tmcm", "./mine"])
def test_a_name_that_is_no_profile_is_exit_2(name: str) -> None:
    Path("mine").mkdir()
    with own("tmcm") as bench:
        ran = bench.run(f"learn --yes --compare {name}")
        assert (ran.code, "error: " in ran.stderr, "hint" in ran.stderr) == (2, True, True), ran


def test_a_folder_s_name_without_a_slash_is_hinted_at() -> None:
    with own("tmcm") as bench:
        assert bench.run("learn --yes --save pump").code == 0
        (Path.home() / ".config/dvtcli/profiles/pump.toml").unlink()
    with own("tmcm") as bench:
        assert "--compare ./pump" in bench.run("learn --yes --compare pump").stderr


def test_no_node_is_started_and_no_pdo_is_sent() -> None:
    wire = VirtualWire(device("generic"))
    with wire.bench() as bench:
        bench.run("node")
        wire.frames()
        ran = bench.run("learn --yes --json")
        assert ran.code == 0, ran
        frames = wire.frames()
        assert not [frame for frame in frames if frame.can_id == NMT]
        talked = {frame.can_id for frame in frames}
        assert talked <= {0x601, 0x581, 0x701}, [f"0x{can_id:03X}" for can_id in talked]
        assert 100 < ran.document["writes"] <= len(sent(frames)) <= ran.document["writes"] + 50


def test_a_node_that_is_operational_is_so_again_afterwards() -> None:
    node = device("generic")
    wire = VirtualWire(node)
    with wire.bench() as bench:
        bench.run("nmt start")
        wire.frames()
        ran = bench.run("learn --yes --json")
        assert ran.code == 0, ran
        bench.session.end_line(0)
        assert node.state is NmtState.OPERATIONAL
        commands = [bytes(frame.data) for frame in wire.frames() if frame.can_id == NMT]
        assert commands == [
            bytes([NmtCommand.ENTER_PRE_OPERATIONAL, 1]),
            bytes([NmtCommand.START, 1]),
        ]


def test_an_enabled_pdo_is_asked_in_pre_operational_only() -> None:
    """Where the node's state is not known, no PDO is enabled."""
    node = device("generic")
    with own("generic") as bench:
        document = bench.run("learn --yes --json").document
        asked = {probe["needs"] for probe in document["probes"] if probe["accepted"] is not None}
    assert asked == {"anywhere", "PRE-OPERATIONAL and a quiet CAN-ID"}
    assert node.state is NmtState.INITIALISING


def test_a_restricted_can_id_takes_isolated() -> None:
    with own("lely") as bench:
        rows = bench.run("learn --yes --json").document["probes"]
        named = [row for row in rows if row["name"].startswith("CAN-ID")]
        assert named
        assert all(row["accepted"] is None and "no other node is on the bus" in row["why"] for row in named)


class TestSaving:
    def test_what_is_saved_is_used_and_marked(self) -> None:
        with own("tmcm") as bench:
            ran = bench.run("learn --yes --save pump --json")
            assert ran.code == 0, ran
            assert [Path(path).name for path in ran.document["saved"]] == [
                "profile.toml", "simulated.toml", "found.json", "pump.eds", "pump.toml", "pump.toml"
            ]  # fmt: skip
            shown = bench.run("profiles show pump --json").document
        values = {row["key"]: row for row in shown["values"]}
        assert values["learnt"]["value"] == "true"
        assert values["rtr_bit.tpdo"]["value"] == '"set"'
        assert "answered 0x06090030" in values["rtr_bit.tpdo"]["reason"]
        with Bench(("./pump",)) as bench:
            assert bench.run("node --json").document["nodes"][0]["profile"] == "pump"
            assert bench.run("map tpdo1 6041 6061").code == 0

    def test_what_is_saved_is_used_by_the_next_line(self) -> None:
        with own("tmcm") as bench:
            assert bench.run("node --json").document["nodes"][0]["profile"] == "tmcm"
            assert bench.run("learn --yes --save pump").code == 0
            assert bench.run("node --json").document["nodes"][0]["profile"] == "pump"

    def test_again_into_its_own_folder(self) -> None:
        with own("tmcm") as bench:
            assert [bench.run("learn --yes --save pump").code for _ in range(2)] == [0, 0]
            assert bench.run("learn --yes --compare pump").code == 0

    def test_what_was_learnt_of_another_device_is_not_written_over(self) -> None:
        with own("tmcm") as bench:
            assert bench.run("learn --yes --save pump").code == 0
        kept, folder = Path.home() / ".config/dvtcli/profiles/pump.toml", Path("pump/profile.toml")
        before = kept.read_text("utf-8")
        with own("gen4") as bench:
            for which in ("pump/profile.toml was", "pump.toml was"):
                ran = bench.run("learn --yes --save pump")
                assert ran.code == 6, ran
                said = " ".join(ran.stderr.split())
                assert f"{which} learnt from another device: TMCM, vendor 0x286 product 0x1844; node 1 is" in said
                assert "--force" in said
                shutil.rmtree("pump", ignore_errors=True)
            assert kept.read_text("utf-8") == before
            assert bench.run("learn --yes --save pump --force").code == 0
        assert kept.read_text("utf-8") == folder.read_text("utf-8") != before

    def test_a_folder_can_be_compared_with(self) -> None:
        with own("tmcm") as bench:
            assert bench.run("learn --yes --save pump").code == 0
            (Path.home() / ".config/dvtcli/profiles/pump.toml").unlink()
            assert bench.run("learn --yes --compare ./pump").code == 0
            ran = bench.run("learn --yes --compare ./pimp")
        ran.failed(2, "./pimp is not a folder with a profile.toml")

    def test_what_is_written_says_who_uses_it_from_now_on(self) -> None:
        with own("tmcm") as bench:
            lines = bench.run("learn --yes --save pump").stdout.splitlines()
        assert lines[-2].endswith("profiles/pump.toml")
        assert "delete the file to revert this" in lines[-1]

    @pytest.mark.parametrize(("name", "code"), [("gen4", 2), ("Pump!", 2), ("mine", 2), ("../pump", 2)])
    def test_no_other_folder(self, name: str, code: int) -> None:
        Path("mine").mkdir()
        Path("mine/notes.txt").write_text("mine")
        with own("tmcm") as bench:
            ran = bench.run(f"learn --yes --save {name}")
            assert ran.code == code, ran
        assert [path.name for path in Path("mine").iterdir()] == ["notes.txt"]

    def test_what_differs_from_a_profile_is_exit_3(self) -> None:
        with own("tmcm") as bench:
            ran = bench.run("learn --yes --compare generic --json")
            assert ran.code == 3
            differing = {row["key"]: (row["profile"], row["learnt"]) for row in ran.document["differences"]}
            assert differing["rtr_bit.tpdo"] == ("keep", "set")


def test_a_device_that_is_locked_is_not_asked() -> None:
    with own("gen4-locked") as bench:
        ran = bench.run("learn --yes --json")
        assert (ran.code, ran.document["state"]) == (1, "unchanged"), ran
        assert "login" in str(ran.document)
