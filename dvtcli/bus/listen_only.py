"""Which of python-can's interfaces can listen without a word, and how each is told: no acknowledge, no error frame.

Does not know what is listened for. What is not in the table (`listen_only.toml`) is not known to be silent.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files

import can


@cache
def silent_settings() -> Mapping[str, Mapping[str, object]]:
    """The settings of each interface that can listen without a word, by its name."""
    told = tomllib.loads((files("dvtcli.bus") / "listen_only.toml").read_text("utf-8"))
    states = {state.name: state for state in can.BusState}
    return {
        name: {key: states[value] if key == "state" else value for key, value in settings.items()}
        for name, settings in told.items()
    }


def is_silent(bus: can.BusABC, settings: Mapping[str, object]) -> bool:
    """Whether *bus* says that it listens only, where its driver can say that; it was opened with *settings*."""
    return settings.get("state") in (None, bus.state)
