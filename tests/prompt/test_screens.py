"""Golden screens: what a person sees at the prompt, in two sizes of terminal, kept as text in `screens/`.

`pytest tests/prompt/test_screens.py --update-transcripts` rewrites them; look at the difference before keeping it.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.prompt.conftest import Open
from tests.prompt.terminal import CTRL_R, Terminal

SCREENS = Path(__file__).parent / "screens"
#: name -> what is typed, and what the finished screen shows
TYPED = {
    "menu": ("map tpdo1 6C01:1 velocity_a", "4 of 6 free bytes"),
    "wrong": ("mpa tpdo1 6041\r", "did you mean 'map'?"),
    "question": ("set tpdo1 ?", "Leave the PDO disabled."),
    "search": (CTRL_R + "xyz", "i-search"),
}
_VOLATILE = [(re.compile(r"HB \d\.\d s"), "HB 0.0 s"), (re.compile(r"dvtcli \d+\.\d+\.\d+"), "dvtcli 0.0.0")]


def steady(terminal: Terminal) -> str:
    text = terminal.text
    for pattern, replacement in _VOLATILE:
        text = pattern.sub(replacement, text)
    return text + "\n"


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (120, 40)])
@pytest.mark.parametrize("name", TYPED)
def test_screen(name: str, columns: int, rows: int, open_terminal: Open, request: pytest.FixtureRequest) -> None:
    file = SCREENS / f"{name}_{columns}.txt"
    keys, shows = TYPED[name]
    terminal = open_terminal("--sim", "gen4", columns=columns, rows=rows)
    terminal.wait_prompt()
    terminal.until(lambda: re.search(r"HB \d\.\d s", terminal.toolbar) is not None, "a heartbeat")
    terminal.type(keys)
    terminal.wait(shows)
    if request.config.getoption("--update-transcripts"):
        file.write_text(steady(terminal), encoding="utf-8")
        return
    expected = file.read_text("utf-8")
    terminal.until(lambda: steady(terminal) == expected, f"the screen\n{expected}\n")
