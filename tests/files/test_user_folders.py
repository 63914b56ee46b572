from __future__ import annotations

import sys
from pathlib import Path

import platformdirs
import pytest

from dvtcli.files.user_folders import Kind, user_folder

XDG = ("XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_STATE_HOME")


@pytest.mark.skipif(sys.platform == "win32", reason="neither HOME nor XDG folders")
@pytest.mark.parametrize("kind", ["config", "data", "state"])
@pytest.mark.parametrize("xdg", [None, "", "/srv/x", "/srv/x/", "relative", "~/x"])
@pytest.mark.parametrize("home", ["/home/me", "/home/me/", "/", "", "relative", None])
def test_it_is_where_platformdirs_says(
    kind: Kind, xdg: str | None, home: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in ((("HOME"), home), *((one, xdg) for one in XDG)):
        if value is None:
            monkeypatch.delenv(name, raising=False)
        else:
            monkeypatch.setenv(name, value)
    said = Path(getattr(platformdirs, f"user_{kind}_dir")("dvtcli"))
    with monkeypatch.context() as as_at_the_start:
        as_at_the_start.delitem(sys.modules, "platformdirs")
        assert user_folder(kind) == said
