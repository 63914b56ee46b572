"""A domain that a device refuses, and then does not let be read: whether anything was taken is not known."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.errors import DeviceRefused
from dvtcli.simulator.device.memory import Refusal
from tests.operations.network.bench import Chain
from tests.surroundings import HOMES

DOMAIN = (0x2002, 0)


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in HOMES:
        monkeypatch.setenv(name, str(tmp_path / "home"))


def refusing(chain: Chain, *, before: bool, since: bool) -> None:
    """Node 5 refuses the domain; *before* and *since* say when it lets it be read."""
    device, refused = chain.devices[5], list[bool]()

    def download(index: int, sub_index: int, data: bytes) -> None:
        if (index, sub_index) == DOMAIN:
            refused.append(True)
            raise Refusal(0x0609_0030)
        type(device).download(device, index, sub_index, data)

    def upload(index: int, sub_index: int) -> bytes:
        if (index, sub_index) == DOMAIN and not (since if refused else before):
            raise Refusal(0x0601_0001)
        return type(device).upload(device, index, sub_index)

    device.download, device.upload = download, upload  # type: ignore[method-assign]


@pytest.mark.parametrize("size", [4, 5, 2000])
@pytest.mark.parametrize(("before", "since"), [(True, True), (True, False), (False, False)])
def test_it_is_not_known_whether_anything_was_taken(tmp_path: Path, size: int, *, before: bool, since: bool) -> None:
    chain = Chain(tmp_path / "files", families={5: "generic"}, operational=False)
    chain.devices[5].set_value(*DOMAIN, b"as it was")
    refusing(chain, before=before, since=since)
    with chain.session(node=5) as session:
        with pytest.raises(DeviceRefused) as told:
            session.node(5).write(*DOMAIN, b"x" * size, force=True)
        assert told.value.abort == 0x0609_0030
        is_known = since or (not before and size <= 4)
        assert told.value.state == ("rolled_back" if is_known else "unknown")
        assert ("unknown whether anything was taken" in str(told.value.state_text)) is not is_known
        assert told.value.hint or is_known
        assert chain.journals() == []
        assert session.node(5).write(0x1801, 5, b"\x09\0"), "nothing blocks it"
