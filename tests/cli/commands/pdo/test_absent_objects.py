"""Objects that nobody describes: without an EDS the device is asked, by one upload, before it is made to map them."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.memory import Refusal
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire
from tests.surroundings import HOMES

EDS = str(family_eds("generic"))
NO_OBJECT, NO_SUB_INDEX, WRITE_ONLY, DEVICE_STATE = 0x06020000, 0x06090011, 0x06010001, 0x08000022


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in HOMES:
        monkeypatch.setenv(name, str(tmp_path / "state"))


class Lax(StrictDevice):
    """A device that maps whatever it is told to, and refuses uploads of `answers` with their aborts."""

    answers: dict[int, int] = {}  # noqa: RUF012 - set on each device

    def upload(self, index: int, sub_index: int) -> bytes:
        if index in self.answers:
            raise Refusal(self.answers[index])
        return super().upload(index, sub_index)

    def download(self, index: int, sub_index: int, data: bytes) -> None:
        if 0x1600 <= index < 0x1800 or 0x1A00 <= index < 0x1C00:
            self.set_value(index, sub_index, data)
            return
        super().download(index, sub_index, data)


def lax(answers: dict[int, int] | None = None) -> Lax:
    device = Lax(read_eds(family_eds("generic")).dictionary, load_family("generic"), 1)
    device.set_value(0x1018, 1, (0xABC).to_bytes(4, "little"))  # of nobody whose EDS is known
    device.answers = answers or {}
    return device


def asked(wire: Wire) -> list[str]:
    """The objects that were uploaded, and those that were written, since the last look: `?6041:00`, `1A00:01`."""
    sent = [bytes(m.data) for m in wire.frames() if m.arbitration_id == 0x601]
    kinds = {2: "?", 1: ""}
    return [
        f"{kinds[data[0] >> 5]}{int.from_bytes(data[1:3], 'little'):04X}:{data[3]:02X}"
        for data in sent
        if data[0] >> 5 in kinds
    ]


@pytest.mark.parametrize("abort", [NO_OBJECT, NO_SUB_INDEX])
@pytest.mark.parametrize(
    "line",
    ["map tpdo1 5FFF:0/8", "map rpdo1 5FFF:0/8", "map tpdo1 6041:0 5FFF:0/8", "apply {}"],
)
def test_an_object_that_the_device_has_not_is_not_mapped(tmp_path: Path, abort: int, line: str) -> None:
    file = tmp_path / "n.yaml"
    file.write_text("nodes: {a: {node_id: 1, tpdo: {1: {enabled: true, mapping: ['5FFF:0/8']}}}}\n")
    device = lax({0x5FFF: abort})
    with Wire(device) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        before = bench.run("pdo --all --json").document["pdos"]
        wire.frames()
        ran = bench.run(line.format(file))
        assert (ran.code, f"0x{abort:08X}" in ran.stderr) == (1, True), ran.stdout + ran.stderr
        seen = asked(wire)
        assert seen.count("?5FFF:00") == 1
        assert not [place for place in seen if not place.startswith("?")]
        assert bench.run("pdo --all --json").document["pdos"] == before
        if "map" in line and "/8" in line:
            ran = bench.run(f"{line} --force")
            assert ran.code == 0, ran.stderr


@pytest.mark.parametrize(("abort", "line"), [(WRITE_ONLY, "map rpdo1 5FFF:0/8"), (DEVICE_STATE, "map tpdo1 5FFF:0/8")])
def test_an_object_that_cannot_be_read_is_there_all_the_same(abort: int, line: str) -> None:
    with Wire(lax({0x5FFF: abort})) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        ran = bench.run(line)
        assert ran.code == 0, ran.stderr


def test_what_the_device_maps_already_is_not_doubted() -> None:
    device = lax({0x5FFF: NO_OBJECT})
    device.set_value(0x1A00, 1, (0x5FFF0008).to_bytes(4, "little"))
    device.set_value(0x1A00, 0, b"\x01")
    with Wire(device) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        ran = bench.run("map tpdo1 5FFF:0/8 6041:0/16")
        assert ran.code == 0, ran.stderr


def test_with_an_eds_no_object_is_asked_for() -> None:
    with Wire(lax()) as wire, Bench((), {**wire.options, "yes": True, "eds": EDS}) as bench:
        wire.frames()
        ran = bench.run("map tpdo1 6041:0 6064:0")
        assert ran.code == 0, ran.stderr
        assert not [place for place in asked(wire) if place.startswith("?6")]
