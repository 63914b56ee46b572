"""Keys are written into dvtcli.toml without touching what is there."""

from __future__ import annotations

import os
import stat
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.errors import InputFileError
from dvtcli.files.settings_file import save_settings, with_settings


def test_what_is_there_stays() -> None:
    text = '# our press\nnode = 5   # the drive\nchannel = "can1"\n'
    new = with_settings(text, {"interface": "socketcan", "channel": "can0"})
    assert new == '# our press\nnode = 5   # the drive\nchannel = "can0"\ninterface = "socketcan"\n'


def test_a_list_and_an_empty_file() -> None:
    assert with_settings("", {"sim": ["generic"]}) == 'sim = ["generic"]\n'


@given(st.text(alphabet=st.characters(exclude_categories=["Cs"], exclude_characters="\x7f")))
def test_any_name_is_kept_as_it_is(name: str) -> None:
    assert tomllib.loads(with_settings("node = 1\n", {"channel": name})) == {"node": 1, "channel": name}


def test_what_cannot_be_added_is_an_error_and_changes_nothing(tmp_path: Path) -> None:
    path = tmp_path / "dvtcli.toml"
    for text in ("not toml at all", 'sim = [\n  "gen4",\n]\n', '"sim" = "gen4"\n'):
        path.write_text(text)
        with pytest.raises(InputFileError):
            save_settings(path, {"sim": ["generic"]})
        assert path.read_text() == text


@pytest.mark.skipif(os.name != "posix", reason="Windows has no modes of this kind")
def test_nobody_else_can_write_what_was_made_whatever_the_umask(tmp_path: Path) -> None:
    path = tmp_path / "dvtcli.toml"
    before = os.umask(0)
    try:
        save_settings(path, {"sim": ["generic"]})
    finally:
        os.umask(before)
    assert stat.S_IMODE(path.stat().st_mode) == 0o644
    path.chmod(0o600)
    save_settings(path, {"sim": ["gen4"]})
    assert (stat.S_IMODE(path.stat().st_mode), path.read_text()) == (0o600, 'sim = ["gen4"]\n')
