"""Strict devices without a bus between: an SDO channel and a network straight on the device, and faults to put in."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from dvtcli.bus.turns import one_by_one
from dvtcli.device.cancellation import Cancellation
from dvtcli.device.change.transaction import Transaction
from dvtcli.device.change.untouched_pdos import UntouchedPdos
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Plan
from dvtcli.domain.ports import Frame, SdoTransport
from dvtcli.domain.profile import GENERIC, DeviceProfile
from dvtcli.domain.rules import Proposal
from dvtcli.errors import NoAnswer, SdoAborted
from dvtcli.files.eds.reader import read_eds
from dvtcli.files.profiles import load_profile, profile_names
from dvtcli.simulator.device.family import Family
from dvtcli.simulator.device.memory import Refusal
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family

FAMILIES = ("generic", "gen4", "espac", "tmcm", "roboteq")
NODE = 1


@lru_cache
def dictionary(family: str) -> ObjectDictionary:
    return read_eds(family_eds(family)).dictionary


@lru_cache
def profile(family: str) -> DeviceProfile:
    return load_profile(family) if family in profile_names() else GENERIC


def booted(family: str = "generic", described: ObjectDictionary | None = None) -> StrictDevice:
    """A device of *family* in PRE-OPERATIONAL, with *described* instead of the family's own dictionary if given."""
    device = StrictDevice(described or dictionary(family), load_family(family), NODE)
    device.boot_up()
    device.take_outbox()
    return device


@dataclass
class DirectSdo:
    """An SDO channel straight on *device*; what was asked and written is kept, in order."""

    device: StrictDevice
    reads: list[tuple[int, int]] = field(default_factory=list)
    writes: list[tuple[int, int, bytes]] = field(default_factory=list)

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        self.reads.append((index, sub_index))
        self._must_answer(index, sub_index)
        try:
            return self.device.upload(index, sub_index)
        except Refusal as refusal:
            raise SdoAborted(index, sub_index, refusal.code, node=self.device.node_id) from refusal

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        self.writes.append((index, sub_index, bytes(data)))
        self._must_answer(index, sub_index)
        try:
            self.device.download(index, sub_index, data)
        except Refusal as refusal:
            raise SdoAborted(index, sub_index, refusal.code, node=self.device.node_id) from refusal

    def _must_answer(self, index: int, sub_index: int) -> None:
        if self.device.state is NmtState.STOPPED:
            raise silence(index, sub_index)


def silence(index: int, sub_index: int) -> NoAnswer:
    return NoAnswer("silent", node=NODE, place=f"{index:04X}:{sub_index:02X}", state="unknown")


Fault = Callable[[SdoTransport, int, int, bytes], None]


def refuse(_inner: SdoTransport, index: int, sub_index: int, _data: bytes) -> None:
    """The device says no."""
    raise SdoAborted(index, sub_index, 0x0800_0021, node=NODE)


def lose_request(_inner: SdoTransport, index: int, sub_index: int, _data: bytes) -> None:
    """The write never arrives."""
    raise silence(index, sub_index)


def lose_answer(inner: SdoTransport, index: int, sub_index: int, data: bytes) -> None:
    """The write arrives, its acknowledgement does not."""
    inner.download(index, sub_index, data)
    raise silence(index, sub_index)


def ignore(_inner: SdoTransport, _index: int, _sub_index: int, _data: bytes) -> None:
    """The device acknowledges and does nothing."""


def correct(inner: SdoTransport, index: int, sub_index: int, data: bytes) -> None:
    """The device takes the write, and makes another value of it: the lowest bit differs."""
    inner.download(index, sub_index, bytes([data[0] ^ 1]) + data[1:])


def crash(_inner: SdoTransport, _index: int, _sub_index: int, _data: bytes) -> None:
    """A bug of ours in the middle of a change."""
    raise RuntimeError("a bug")


def interrupt_before(_inner: SdoTransport, _index: int, _sub_index: int, _data: bytes) -> None:
    """A second Ctrl-C while a write is about to be sent."""
    raise KeyboardInterrupt


def interrupt_after(inner: SdoTransport, index: int, sub_index: int, data: bytes) -> None:
    """A second Ctrl-C just after a write was taken."""
    inner.download(index, sub_index, data)
    raise KeyboardInterrupt


@dataclass
class FaultySdo:
    """*inner* with *fault* at the *at*-th download (1 and up), and at every later one where *forever*."""

    inner: SdoTransport
    fault: Fault
    at: int
    forever: bool = False
    count: int = 0

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        return self.inner.upload(index, sub_index, timeout_s=timeout_s, retries=retries)

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        self.count += 1
        if self.count == self.at or (self.forever and self.count > self.at):
            self.fault(self.inner, index, sub_index, data)
        else:
            self.inner.download(index, sub_index, data, timeout_s=timeout_s)


@dataclass
class DirectBus:
    """A network of one device without frames or threads; NMT commands are kept, in order."""

    device: StrictDevice
    channel: SdoTransport
    commands: list[NmtCommand] = field(default_factory=list)
    heard_boot_ups: int = 0
    slept_s: float = 0.0
    name: str = "direct"
    simulated: bool = True
    carries_remote_frames: bool = True

    @classmethod
    def of(cls, device: StrictDevice) -> DirectBus:
        return cls(device, DirectSdo(device))

    def sdo(self, node_id: int) -> SdoTransport:
        assert node_id == self.device.node_id
        return self.channel

    def send_nmt(self, command: NmtCommand, node_id: int) -> None:
        self.commands.append(command)
        self.device.nmt(command)
        self.heard_boot_ups += sum(frame.can_id == 0x700 + NODE for frame in self.device.take_outbox())

    def nodes_seen(self) -> dict[int, NmtState]:
        return {}

    def nmt_state(self, node_id: int, timeout_s: float = 0.0) -> NmtState | None:
        return self.device.state

    def boot_ups(self, node_id: int) -> int:
        return self.heard_boot_ups

    def order_restart(self, node_id: int, within_s: float) -> None:
        """No restart is counted here."""

    def disturbance_count(self, node_id: int) -> int:
        return self.boot_ups(node_id)

    def downloads_of_others(self, node_id: int) -> int:
        return 0

    def happened(self, node_id: int) -> tuple[int, int]:
        return self.disturbance_count(node_id), self.downloads_of_others(node_id)

    def side_by_side(self, jobs: Sequence[Callable[[], None]]) -> list[BaseException]:
        return one_by_one(jobs)

    def wait_boot_up(self, node_id: int, seen: int, timeout_s: float) -> bool:
        return self.heard_boot_ups > seen

    def send(self, frame: Frame) -> None:
        self.device.services.receive(frame)

    def receive(self, duration_s: float) -> Iterator[Frame]:
        yield from self.device.take_outbox()

    def now_s(self) -> float:
        return self.slept_s

    def drain(self) -> None:
        """Nothing arrives but what is asked for."""

    def sleep(self, duration_s: float) -> None:
        self.slept_s += max(duration_s, 0)

    def close(self) -> None:
        self.device.take_outbox()


def proposal(
    pdo: Pdo,
    now: PdoConfig,
    want: PdoConfig,
    described: ObjectDictionary | None,
    family: DeviceProfile = GENERIC,
    others: dict[Pdo, PdoConfig] | None = None,
) -> Proposal:
    """What the rules look at, with the defaults of node 1."""
    return Proposal(NODE, pdo, now, want, others or {}, family, described)


def plain(family: str) -> Family:
    """How *family*'s simulated devices behave."""
    return load_family(family)


class InstantClock:
    """Time that passes only when somebody waits, and then at once."""

    def __init__(self) -> None:
        self._now_s = 0.0

    def now_s(self) -> float:
        return self._now_s

    def sleep(self, duration_s: float) -> None:
        self._now_s += duration_s


class NeverRestarts:
    """A monitor for a node that never restarts, such as a device called directly."""

    def boot_ups(self) -> int:
        return 0

    def disturbance_count(self) -> int:
        return 0


def transaction(sdo: SdoTransport, plan: Plan, **how: Any) -> Transaction:
    """One run of *plan* on a device without restarts, which has no other PDOs; *how* replaces defaults."""
    alone: dict[str, Any] = {
        "cancellation": Cancellation(), "clock": InstantClock(), "reboot_monitor": NeverRestarts(),
        "explain": lambda _aborted: None, "on_step": lambda _step: None, "before_retry": lambda: None,
        "on_altered": lambda _changes: None, "others": UntouchedPdos(), "control_words": (), "boot_ups_read": None,
    }  # fmt: skip
    return Transaction(sdo, plan, **{**alone, **how})
