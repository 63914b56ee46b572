"""A device that takes a parameter only while the PDO is off: put back, done again that way, and remembered."""

from __future__ import annotations

from pathlib import Path

import can
import pytest

from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.pdo import Direction
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.memory import Refusal
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from tests.cli.commands.bench import Bench, Ran
from tests.cli.commands.bus import Wire
from tests.surroundings import HOMES, kept_in

pytestmark = pytest.mark.drawn(10, "second try")

EDS = str(family_eds("generic"))


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in HOMES:
        monkeypatch.setenv(name, str(tmp_path / "state"))


def stricter(kind: type[StrictDevice] = StrictDevice, node_id: int = 1, **codes: int) -> StrictDevice:
    """A device that refuses parameters of a PDO that is on: `type_while_valid=0x06090030`."""
    answers = {name.replace("_", "-"): code for name, code in codes.items()}
    family = load_family("generic")._replace(answers=dict.fromkeys(Direction, answers))
    device = kind(read_eds(family_eds("generic")).dictionary, family, node_id)
    device.set_value(0x1018, 1, (0xABC).to_bytes(4, "little"))
    return device


def on(wire: Wire) -> Bench:
    return Bench((), {**wire.options, "yes": True, "eds": EDS})


def written(wire: Wire) -> list[str]:
    """The objects that were written since the last look."""
    sent = [bytes(m.data) for m in wire.frames() if m.arbitration_id == 0x601]
    return [f"{int.from_bytes(data[1:3], 'little'):04X}:{data[3]:02X}" for data in sent if data[0] >> 5 == 1]


@pytest.mark.parametrize("abort", [0x06090030, 0x08000022, 0x06010002])
@pytest.mark.parametrize(
    ("check", "line", "place"),
    [
        ("type_while_valid", "set tpdo1 --sync 3", "1800:02"),
        ("event_while_valid", "set tpdo1 --timer 30", "1800:05"),
        ("type_while_valid", "set rpdo1 --sync 3", "1400:02"),
    ],
)
def test_it_is_done_again_with_the_pdo_off_and_known_after_two(abort: int, check: str, line: str, place: str) -> None:
    with Wire(stricter(**{check: abort})) as wire:
        with on(wire) as bench:
            before = bench.run("pdo --all --json").document["pdos"]
            wire.frames()
            ran = bench.run(line)
            assert ran.code == 0, ran.stderr
            cob_id = f"{place[:4]}:01"
            assert written(wire) == [place, cob_id, place, cob_id], "refused, so nothing is to be rolled back"
            said = " ".join(ran.stdout.split() + ran.stderr.split())
            assert f"0x{place} was refused while" in said
            assert f"(abort 0x{abort:08X})" in said
            assert "if it happens again, it is remembered" in said
            wire.frames()
            ran = bench.run("undo")
            assert ran.code == 0
            assert written(wire) == [place, cob_id, place, cob_id], "the first refusal may have been a passing one"
            assert "this is saved as a need" in " ".join(ran.stdout.split() + ran.stderr.split())
            assert bench.run("pdo --all --json").document["pdos"] == before
        with on(wire) as another:
            wire.frames()
            ran = another.run(line)
            assert (ran.code, "was refused" in ran.stdout) == (0, False), ran.stderr
            assert written(wire) == [cob_id, place, cob_id], "a later process knows it, too"


def test_what_else_was_in_the_plan_is_put_back_before_it_is_done_again() -> None:
    with Wire(stricter(event_while_valid=0x06090030)) as wire, on(wire) as bench:
        wire.frames()
        ran = bench.run("set tpdo1 --sync 3 --timer 30")
        assert ran.code == 0, ran.stderr
        parameters = [place for place in written(wire) if place.startswith("18")]
        assert parameters == [
            *("1800:02", "1800:05"),
            "1800:02",
            *("1800:01", "1800:02", "1800:05", "1800:01"),
        ]


def test_a_value_that_is_wrong_anyway_is_refused_with_everything_as_it_was() -> None:
    class Choosy(StrictDevice):
        """A device that takes one transmission type only, and says so with the same abort code."""

        def download(self, index: int, sub_index: int, data: bytes) -> None:
            if (index, sub_index) == (0x1800, 2) and data != b"\xff":
                raise Refusal(0x06090030)
            super().download(index, sub_index, data)

    with Wire(stricter(Choosy)) as wire, on(wire) as bench:
        before = bench.run("pdo --all --json").document["pdos"]
        ran = bench.run("set tpdo1 --sync 3")
        assert ran.code == 1
        assert "first try" in ran.stderr
        assert "rolled back" in ran.stderr
        assert bench.run("pdo --all --json").document["pdos"] == before
    with Wire(stricter()) as wire, on(wire) as another:
        wire.frames()
        assert another.run("set tpdo1 --sync 5").code == 0
        assert written(wire) == ["1800:02"], "nothing was learnt from it"


def test_a_pdo_that_could_not_be_enabled_again_is_not_switched_off() -> None:
    """Its COB-ID is one that the rules refuse: 0x180, as some drives have it from the factory."""
    device = stricter(type_while_valid=0x06090030)
    device.set_value(0x1800, 1, (0x40000180).to_bytes(4, "little"))
    with Wire(device) as wire, on(wire) as bench:
        wire.frames()
        ran = bench.run("set tpdo1 --sync 3")
        assert ran.code == 1
        assert written(wire) == ["1800:02"]
        assert "0x06090030" in ran.stderr


def test_a_roll_back_and_a_recovery_find_the_way_too(tmp_path: Path) -> None:
    class ForgetfulOnce(StrictDevice):
        """A device that shows another event timer than the one that was written, as long as it is asked to."""

        lies = 0

        def upload(self, index: int, sub_index: int) -> bytes:
            data = super().upload(index, sub_index)
            if (index, sub_index) == (0x1800, 5) and self.lies and data != b"\0\0":
                self.lies -= 1
                return b"\x01\0"
            return data

    device = stricter(ForgetfulOnce, type_while_valid=0x06090030)
    assert isinstance(device, ForgetfulOnce)
    with Wire(device) as wire, on(wire) as bench:
        assert bench.run("set tpdo1 --sync 3").code == 0
        assert bench.run("undo").code == 0
        before = bench.run("pdo --all --json").document["pdos"]
        device.lies = 1
        ran = bench.run("set tpdo1 --sync 3 --timer 30")
        assert ran.code == 1, ran.stderr
        assert "rolled back" in ran.stderr
        assert bench.run("pdo --all --json").document["pdos"] == before


def unnamed(identity: bytes | None, kind: type[StrictDevice] = StrictDevice) -> StrictDevice:
    """A stricter device whose vendor-ID is *identity*, or that has no identity object."""

    class Unnamed(kind):  # type: ignore[misc,valid-type]
        def upload(self, index: int, sub_index: int) -> bytes:
            if index == 0x1018 and identity is None:
                raise Refusal(0x06020000)
            if (index, sub_index) == (0x1018, 1):
                return identity or b""
            return bytes(super().upload(index, sub_index))

    return stricter(Unnamed, type_while_valid=0x06090030)


@pytest.mark.parametrize("identity", [None, bytes(4)])
def test_what_a_node_without_identity_wants_is_known_of_this_node_and_session_only(
    identity: bytes | None, tmp_path: Path
) -> None:
    with Wire(unnamed(identity)) as wire:
        with on(wire) as bench:
            for line in ("set tpdo1 --sync 3", "set tpdo1 --sync 4"):
                ran = bench.run(line)
                assert ran.code == 0, ran.stderr
            assert "the node says no identity" in " ".join(ran.stdout.split() + ran.stderr.split())
            wire.frames()
            assert bench.run("set tpdo1 --sync 5").code == 0
            assert written(wire) == ["1800:01", "1800:02", "1800:01"]
        assert not list((tmp_path / "state").rglob("habits/*"))
        with on(wire) as another:
            wire.frames()
            assert another.run("set tpdo1 --sync 6").code == 0
            assert written(wire) == ["1800:02", "1800:01", "1800:02", "1800:01"]


def test_one_that_refuses_in_its_present_state_while_it_runs_is_not_remembered(tmp_path: Path) -> None:
    device = stricter(type_while_valid=0x08000022)
    with Wire(device) as wire, on(wire) as bench:
        assert bench.run("nmt start").code == 0
        for line in ("set tpdo1 --sync 3", "set tpdo1 --sync 4", "set tpdo1 --sync 5"):
            wire.frames()
            ran = bench.run(line)
            assert ran.code == 0, ran.stderr
            assert written(wire) == ["1800:02", "1800:01", "1800:02", "1800:01"]
            assert "OPERATIONAL, so nothing is remembered" in " ".join(ran.stdout.split() + ran.stderr.split())
        assert not list((tmp_path / "state").rglob("habits/*"))


def test_what_is_remembered_is_shown_and_forgotten(tmp_path: Path) -> None:
    folder = kept_in(tmp_path / "state") / "habits"
    with Wire(stricter(type_while_valid=0x06090030)) as wire, on(wire) as bench:
        assert bench.run("profiles habits").stdout == "no needs of devices are recorded\n"
        assert bench.run("profiles forget all").code == 0
        assert bench.run("set tpdo1 --sync 3").code == 0
        (device,) = bench.run("profiles habits --json").document["devices"]
        assert device["off_first"] == [
            {"direction": "tpdo", "sub_index": 2, "abort": 0x06090030, "times": 1, "counts": False}
        ]
        assert "tried first" in bench.run("profiles habits").stdout
        assert bench.run("set tpdo1 --sync 4").code == 0
        shown = bench.run("profiles habits").stdout
        assert device["name"] in shown
        assert "disabled first" in shown
        assert "profiles habits" in bench.run("doctor").stdout
        ran = bench.run("profiles forget 12345678-0-0")
        assert (ran.code, device["name"] in ran.stderr) == (2, True)
        assert bench.run("profiles forget").code == 2
        assert bench.run("profiles habits tmcm").code == 2
        assert (
            f"forgotten: the recorded needs of {device['name']}"
            in bench.run(f"profiles forget {device['name'].lower()}").stdout
        )
        assert not list(folder.iterdir())
    with Wire(stricter(type_while_valid=0x06090030)) as wire, on(wire) as bench:
        wire.frames()
        assert bench.run("set tpdo1 --sync 5").code == 0
        assert written(wire) == ["1800:02", "1800:01", "1800:02", "1800:01"], "found out anew"


def test_an_invalid_memory_is_said_and_found_out_anew(tmp_path: Path) -> None:
    with Wire(stricter(type_while_valid=0x06090030)) as wire:
        with on(wire) as bench:
            assert bench.run("set tpdo1 --sync 3").code == 0
        (path,) = (kept_in(tmp_path / "state") / "habits").glob("*.json")
        assert oct(path.stat().st_mode & 0o777) == "0o600"
        for text in (
            '{"schema": "dvtcli.habits/1", "off_first": [["tpdo", 2]]}',
            '{"schema": "dvtcli.habits/2"}',
            '{"schema": "dvtcli.habits/2", "refused": [7]}',
            '{"schema": "dvtcli.habits/2", "refused": [{"direction": "tpdo", "sub_index": 1, "abort": 1, "times": 1}]}',
            '{"schema": "dvtcli.habits/2", "refused": [{"direction": "up", "sub_index": 2, "abort": 1, "times": 1}]}',
        ):
            path.write_text(text)
            with on(wire) as bench:
                assert "it cannot be read" in bench.run("profiles habits").stdout
                ran = bench.run("set tpdo1 --sync 4")
                assert ran.code == 0
                assert f"{path} is damaged" in ran.stderr
                assert bench.run("undo").code == 0


def test_simulated_nodes_are_remembered_as_long_as_they_live() -> None:
    with Bench(("generic",)) as bench:
        assert not bench.session.node().habits.are_there


# --- what was asked


def test_a_signature_that_is_forced_is_sent_as_it_was_typed() -> None:
    with Bench(("generic",)) as bench:
        assert bench.run("write 1010:1 0x12345678").code == 1
        ran = bench.run("write 1010:1 0x12345678 --force")
        assert ran.code == 1
        assert "0x08000020" in ran.stderr, "the device itself refused it"
    with Bench(("generic",)) as bench:
        ran = bench.run("write 1010:1 save --force --json")
        assert ran.document["schema"] == "dvtcli.store/1", "that is a store like any other"


def test_one_that_the_device_takes_is_not_read_back_as_if_it_were_a_value() -> None:
    class Lax(StrictDevice):
        taken = b""

        def download(self, index: int, sub_index: int, data: bytes) -> None:
            if index == 0x1010:
                self.taken = data
                return
            super().download(index, sub_index, data)

    device = stricter(Lax)
    assert isinstance(device, Lax)
    with Wire(device) as wire, on(wire) as bench:
        ran = bench.run("write 1010:1 0x12345678 --force")
        assert ran.code == 0, ran.stderr
        assert device.taken == bytes.fromhex("78563412")


@pytest.mark.parametrize("abort", [0x08000000, 0x08000022])
@pytest.mark.parametrize(("line", "yes"), [("set tpdo1 --inhibit 10", False), ("write 1017 70", True)])
def test_a_refusal_of_a_node_that_runs_hints_to_stop_it(abort: int, line: str, yes: bool) -> None:
    class Busy(StrictDevice):
        def download(self, index: int, sub_index: int, data: bytes) -> None:
            if self.state is NmtState.OPERATIONAL:
                raise Refusal(abort)
            super().download(index, sub_index, data)

    device = stricter(Busy)
    with Wire(device) as wire, on(wire) as bench:
        assert bench.run("nmt start").code == 0
        bench.session.base = bench.session.options = bench.session.base._replace(yes=yes)
        ran = bench.run(line)
        assert ran.code == 1
        assert "nmt preop 1" in ran.stderr
        with wire.lock:
            device.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
        assert bench.run("nmt preop").code == 0
        assert bench.run(line).code == 0


def gated(family: str, abort: int, first: int = 0x1400, last: int = 0x1BFF) -> StrictDevice:
    """A device of *family* that takes writes to PDOs in PRE-OPERATIONAL only, and answers *abort* otherwise."""
    kind = load_family(family)._replace(pre_operational_writes=((first, last),), wrong_state=abort)
    device = StrictDevice(read_eds(family_eds(family)).dictionary, kind, 1)
    device.set_value(0x1018, 1, (0xABC).to_bytes(4, "little"))
    return device


def commands(frames: list[can.Message]) -> list[int]:
    """The NMT commands among *frames*."""
    return [m.data[0] for m in frames if m.arbitration_id == 0]


def typed(bench: Bench, line: str) -> Ran:
    """Run *line* as one that ends: the node goes back to its NMT state."""
    ran = bench.run(line)
    bench.session.end_line(ran.code)
    return ran


THERE_AND_BACK = [NmtCommand.ENTER_PRE_OPERATIONAL, NmtCommand.START]
#: profiles that ask for no PRE-OPERATIONAL by themselves
FAMILIES = ["generic", "lely", "canopennode"]


@pytest.mark.parametrize("abort", [0x08000000, 0x08000022])
@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("line", ["set tpdo1 --timer 30", "disable tpdo1", "clear tpdo1", "write 1800:5 30"])
def test_a_running_node_goes_to_pre_operational_and_back_once_and_is_known_after_two(
    abort: int, family: str, line: str
) -> None:
    device = gated(family, abort)
    with Wire(device) as wire:
        options = {**wire.options, "yes": True, "eds": str(family_eds(family)), "force": True}
        with Bench((), options) as bench:
            if bench.run("enable tpdo1").code:
                assert bench.run("set tpdo1 --cob-id 0x1A5").code == 0
            assert bench.run("nmt start").code == 0
            before = bench.run("pdo --all --json").document["pdos"]
            wire.frames()
            ran = typed(bench, line)
            assert ran.code == 0, ran.stderr
            assert commands(wire.frames()) == THERE_AND_BACK
            assert "if it happens again, it is remembered" in " ".join(ran.stdout.split() + ran.stderr.split())
            assert device.state is NmtState.OPERATIONAL
            ran = typed(bench, "undo")
            assert ran.code == 0, ran.stderr
            assert "this is saved as a need" in " ".join(ran.stdout.split() + ran.stderr.split())
            assert bench.run("pdo --all --json").document["pdos"] == before
        with Bench((), options) as later:
            wire.frames()
            ran = typed(later, line)
            frames = wire.frames()
            assert (ran.code, "was refused" in ran.stdout) == (0, False), ran.stderr
            assert commands(frames) == THERE_AND_BACK
            refused = [bytes(m.data[4:]) for m in frames if m.arbitration_id == 0x581 and m.data[0] == 0x80]
            assert abort.to_bytes(4, "little") not in refused, "it was there before the first write"
        assert "PDO writes while it is OPERATIONAL" in Bench(()).run("profiles habits").stdout


@pytest.mark.parametrize("abort", [0x08000000, 0x08000022])
def test_without_consent_a_running_node_is_left_as_it_was(abort: int) -> None:
    device = gated("generic", abort)
    with Wire(device) as wire, Bench((), {**wire.options, "eds": EDS}) as bench:
        assert bench.run("nmt start").code == 0
        before = bench.run("pdo --all --json").document["pdos"]
        wire.frames()
        ran = typed(bench, "set tpdo1 --timer 30")
        assert ran.code == 1
        assert "goes there and back" in ran.stderr
        assert commands(wire.frames()) == []
        assert bench.run("pdo --all --json").document["pdos"] == before


@pytest.mark.parametrize("abort", [0x08000000, 0x08000022])
def test_what_is_refused_there_too_is_as_it_was_and_the_node_runs_again(abort: int) -> None:
    class Never(StrictDevice):
        """A device that takes no other event timer, whatever its state."""

        def download(self, index: int, sub_index: int, data: bytes) -> None:
            if (index, sub_index) == (0x1800, 5) and data != bytes(2):
                raise Refusal(abort)
            super().download(index, sub_index, data)

    device = Never(read_eds(family_eds("generic")).dictionary, load_family("generic"), 1)
    with Wire(device) as wire, on(wire) as bench:
        assert bench.run("nmt start").code == 0
        before = bench.run("pdo --all --json").document["pdos"]
        wire.frames()
        ran = typed(bench, "set tpdo1 --timer 30")
        assert ran.code == 1
        assert "while the node was OPERATIONAL, too" in " ".join(ran.stderr.split())
        assert commands(wire.frames()) == THERE_AND_BACK
        assert device.state is NmtState.OPERATIONAL
        assert bench.run("pdo --all --json").document["pdos"] == before
        assert "no needs of devices are recorded" in bench.run("profiles habits").stdout


def test_that_it_went_there_and_back_is_a_finding() -> None:
    options = {"yes": True, "eds": str(family_eds("generic"))}
    with Wire(gated("generic", 0x08000022)) as wire, Bench((), {**wire.options, **options}) as bench:
        assert bench.run("nmt start").code == 0
        document = bench.run("set tpdo1 --timer 30 --json").document
    assert "pre-operational-first" in [finding["rule"] for finding in document["findings"]]
