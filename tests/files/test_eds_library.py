"""The collection of EDS files: kept by identity, found again by it."""

from __future__ import annotations

from pathlib import Path

import can
import pytest

from dvtcli.cli.conversation import Conversation
from dvtcli.cli.view.output import Output
from dvtcli.domain.object_dictionary import DeviceInfo
from dvtcli.errors import InputFileError
from dvtcli.files.eds import own_files as eds_library
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from tests.served_nodes import ServedNodes


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))


def test_the_same_revision_wins_over_a_newer_one(tmp_path: Path) -> None:
    file = tmp_path / "drive.eds"
    file.write_bytes(b"[FileInfo]\n")
    for revision in (1, 2, 3):
        eds_library.add(file, DeviceInfo(vendor_id=0x1E, product_code=5, revision_number=revision))
    found = eds_library.find(0x1E, 5, 2)
    assert found is not None
    assert found.name == "0000001E-00000005-00000002_drive.eds"
    newest = eds_library.find(0x1E, 5, 9)
    assert newest is not None
    assert newest.name.startswith("0000001E-00000005-00000003")
    assert eds_library.find(0x1E, 6, 2) is None


def test_a_file_without_identity_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match="no vendor or product number"):
        eds_library.add(tmp_path / "x.eds", DeviceInfo())


def test_a_node_on_a_real_bus_gets_the_file_of_its_identity() -> None:
    path = family_eds("gen4")
    dictionary = read_eds(path).dictionary
    eds_library.add(path, dictionary.info)
    with can.Bus("eds-library", interface="virtual") as bus:
        network = ServedNodes(bus, [StrictDevice(dictionary, load_family("gen4"), 5)])
        session = Conversation(Output())
        session.start({"interface": "virtual", "channel": "eds-library", "node": 5})
        network.start()
        try:
            node = session.node()
            assert node.dictionary is not None
            assert node.dictionary.source.endswith("_gen4.eds")
            assert node.profile.name == "gen4"
        finally:
            network.stop()
            session.close()
