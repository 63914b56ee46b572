"""A served node whose state can be seen past the bus, and dvtcli processes at work on it, which may be killed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dvtcli.device.read_pdos import present_pdos, read_pdo
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.simulator.device.strict_device import StrictDevice
from tests import process
from tests.cli.prompt.wire import Wire
from tests.harness.forked import Forked
from tests.process import PATIENCE_S
from tests.simulator.serve.served import bus_words

MAP = ("map", "tpdo1", "6C01:1", "606C", "6041", "--cob-id", "0x201", "--sync", "1")
#: disable, type, count, three entries, count, COB-ID
STEPS = 8


@dataclass
class Direct:
    """The device's dictionary without a bus: what it really holds."""

    device: StrictDevice

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        from dvtcli.errors import SdoAborted
        from dvtcli.simulator.device.memory import Refusal

        try:
            return self.device.upload(index, sub_index)
        except Refusal as refusal:
            raise SdoAborted(index, sub_index, refusal.code) from refusal

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        raise AssertionError("the test never writes")


class Bench:
    """A served node, a state folder, and dvtcli processes that use both."""

    def __init__(self, folder: Path, family: str = "gen4") -> None:
        self.wire = Wire(family=family)
        self.folder = folder
        node = ["-n", "5", "--eds", str(self.wire.eds), "--journal", str(folder)]
        self.words = [*bus_words(self.wire.port), *node]

    def start(self, *words: str) -> Forked:
        return process.start([*self.words, *words])

    def run(self, *words: str) -> tuple[int, str, str]:
        child = self.start(*words)
        stdout, stderr = child.communicate(timeout=PATIENCE_S)
        return child.returncode, stdout, stderr

    def killed(self, step: int, *words: str) -> None:
        """Run a line whose process is killed at its SDO download *step*, which the node takes all the same."""

        def kill(number: int) -> None:
            if number == step:
                child.kill()
                child.wait()

        with self.wire.at_work:
            child = self.start(*words)
            self.wire.at_download = kill
        child.communicate(timeout=PATIENCE_S)
        assert child.returncode == -9
        self.wire.at_download = lambda _number: None

    def pdos(self) -> dict[Pdo, PdoConfig]:
        sdo = Direct(self.wire.device)
        with self.wire.at_work:  # a killed child is gone before the node has seen its last request
            return {pdo: read_pdo(sdo, pdo) for pdo in present_pdos(sdo, None)}

    def journals(self) -> list[Path]:
        folder = self.folder / "journals"
        return sorted(folder.glob("*.json")) if folder.is_dir() else []
