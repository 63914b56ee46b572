"""A file that was replaced is read anew, also where the new one has the old one's size and time, as `tar` makes it."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from dvtcli.files.profiles import load_profile
from dvtcli.operations.session.simulated_nodes import read_dictionary
from dvtcli.simulator.network.family_file import family_eds

TIME_NS = 10**18


def written_over(path: Path, data: bytes) -> None:
    path.write_bytes(data)
    os.utime(path, ns=(TIME_NS, TIME_NS))


def put_in_its_place(path: Path, data: bytes) -> None:
    other = path.with_name("other")
    written_over(other, data)
    other.replace(path)


HOW = pytest.mark.parametrize("replace", [written_over, put_in_its_place])


@HOW
def test_an_eds(replace: Callable[[Path, bytes], None], tmp_path: Path) -> None:
    path, text = tmp_path / "device.eds", family_eds("gen4").read_bytes()
    replace(path, text)
    assert read_dictionary(path).display_name(0x6041, 0) == "Statusword"
    replace(path, text.replace(b"Statusword", b"Controller"))
    assert read_dictionary(path).display_name(0x6041, 0) == "Controller"


@HOW
def test_a_profile(replace: Callable[[Path, bytes], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    path = tmp_path / "dvtcli" / "profiles" / "mine.toml"
    path.parent.mkdir(parents=True)
    for title in ("First", "Other"):
        replace(path, f'name = "mine"\ntitle = "{title}"\n'.encode())
        assert load_profile("mine").title == title
