"""A simulated node in virtual time, met as one of a real bus: nothing is waited for, and each run is the same."""

from __future__ import annotations

from typing import Any

from dvtcli.domain.ports import Frame
from dvtcli.files.eds.reader import read_eds
from dvtcli.files.profiles import profile_names
from dvtcli.simulator.device.simulated_faults import Fault
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import device
from tests.virtual_time import VirtualTimeBus


class VirtualWire:
    """*device* with *faults*, which are words of `--fault`; each bench meets it on a bus of its own, faults anew."""

    def __init__(self, device: StrictDevice, *, faults: tuple[str, ...] = ()) -> None:
        self.device = device
        self._faults = faults
        self._seen: list[Frame] = []

    def bench(self, options: dict[str, Any] | None = None) -> Bench:
        """A session with the node, and its bus."""
        bus = VirtualTimeBus([self.device], faults=[Fault.parse(word) for word in self._faults], simulated=False)
        bus.tap(lambda frame, _sent: self._seen.append(frame))
        return Bench((), {"node": self.device.node_id, **(options or {})}, bus)

    def frames(self) -> list[Frame]:
        """Every frame since the last call, from both sides."""
        seen, self._seen = self._seen, []
        return seen


def own(family: str, options: dict[str, Any] | None = None) -> Bench:
    """As `Bench((family,), options)` has it: a device of *family* with its EDS, and its profile.

    That is found by the node's identity, where it has one.
    """
    node, path = device(family), family_eds(family)
    given = {"eds": str(path)} | dict(options or {})
    if family in profile_names() and not read_eds(path).dictionary.info.vendor_id:
        given.setdefault("profile", family)
    return VirtualWire(node, faults=given.pop("fault", ())).bench(given)
