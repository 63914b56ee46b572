"""What a failure says is so: where it was, why, and in which state the node is."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.nmt import NmtCommand
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from tests.cli.commands.bench import Bench, beside


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


@pytest.mark.parametrize(
    ("line", "place"),
    [
        ("map tpdo1 6041 606C 5FFF", "1A00:03"),
        ("map tpdo1 6041 5FFF", "1A00:02"),
        ("map tpdo1 5FFF", "1A00:01"),
        ("map rpdo1 dummy/24 5FFF", "1600:03"),
    ],
)
def test_an_object_that_is_not_there_is_at_its_own_entry(line: str, place: str) -> None:
    with Bench(("generic",)) as bench:
        ran = bench.run(f"{line} --json")
        assert (ran.code, ran.document["object"]) == (1, place)


def test_one_lost_frame_is_not_put_down_to_power_or_bit_rate() -> None:
    with Bench(("generic",), {"fault": ("lose-response@1",), "yes": True, "timeout": 0.1}) as bench:
        assert bench.run("read 1000").code == 0
        ran = bench.run("write 1017 70")
        assert ran.code == 5
        assert "bit rate" not in ran.stderr
    with Bench(("generic",), {"timeout": 0.1}) as bench:
        ran = bench.run("node 9")
        assert ran.code == 5
        assert "check power, node-ID and bit rate" in ran.stderr


@pytest.mark.parametrize("step", range(1, 7))
def test_a_time_out_is_not_explained_by_a_missing_eds(step: int) -> None:
    node = StrictDevice(read_eds(family_eds("generic")).dictionary, load_family("generic"), 1)
    with Bench((), {"node": 1, "yes": True}, beside([node], f"lose-response@{step}")) as bench:
        ran = bench.run("map tpdo1 6041 606C")
        assert ran.code == 5, ran.stdout
        assert "no EDS" not in ran.stderr


def test_a_store_that_was_acknowledged_by_a_node_that_went_away_says_so() -> None:
    from dvtcli.device.store.store_parameters import StoreAnswer
    from dvtcli.domain.objects import STORE_PARAMETERS
    from dvtcli.errors import DeviceRefused
    from dvtcli.operations.changes.store_restore import refuse_after_restart

    with Bench(("generic",)) as bench, pytest.raises(DeviceRefused) as caught:
        refuse_after_restart(bench.session.node(), -1, StoreAnswer(STORE_PARAMETERS, 1, 0.1))
    assert caught.value.why == "0x1010:01 acknowledged the store"


class Quiet(StrictDevice):
    """A device that obeys no reset, and goes on with its heartbeats."""

    def nmt(self, command: int) -> None:
        if command not in (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION):
            super().nmt(command)


def test_a_reset_without_a_boot_up_but_with_heartbeats_tells_the_state() -> None:
    from dvtcli.device.nmt_gate import NodeAccess
    from dvtcli.device.resets import reset_and_wait
    from dvtcli.errors import NoAnswer
    from tests.device.test_reset import WithoutSdo
    from tests.laws.bench import NODE, dictionary, profile

    device = Quiet(dictionary("generic"), load_family("generic"), NODE)
    device.set_value(0x1017, 0, b"\x64\0")
    bus = WithoutSdo([device])  # any answer would end the wait
    with pytest.raises(NoAnswer) as caught:
        reset_and_wait(NodeAccess(bus, NODE, profile("generic")), NmtCommand.RESET_NODE)
    assert (caught.value.state_text or "").startswith("PRE-OPERATIONAL, by its heartbeat")


@pytest.mark.parametrize(("word", "offered"), [("history", ""), ("trace", ""), ("start", ""), ("stroe", "store")])
def test_no_command_is_offered_for_a_word_that_is_not_near_it(word: str, offered: str) -> None:
    with Bench(("generic",)) as bench:
        ran = bench.run(word)
        assert ran.code == 2
        hint = f"did you mean `dvtcli --sim generic {offered}`?"
        assert (hint in ran.stderr) if offered else "did you mean" not in ran.stderr
