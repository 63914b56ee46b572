"""Signals at the prompt: in the middle of a change, of a store, and where nothing runs; the device is looked at."""

from __future__ import annotations

import itertools
import random
import signal
import sys
from collections.abc import Iterator

import pytest

from dvtcli.domain.nmt import NmtState
from tests.cli.prompt.conftest import Open
from tests.cli.prompt.test_real_bus import opened, prompt
from tests.cli.prompt.wire import Wire
from tests.posix import SIGHUP

CODES = {signal.SIGINT: 130, signal.SIGTERM: 143, SIGHUP: 129}
MAP = "map tpdo1 6C01:1 606C 6041 --cob-id 0x201 --sync 1"
#: what is typed, and the SDO download of it that brings the signal; none: it comes where nothing runs
STRUCK = (*((MAP, step) for step in range(2, 9)), ("store", 1), ("store --prove", 1), ("store --prove", 2), ("", 0))
PLACES = ((0x1800, 1), (0x1800, 2), (0x1801, 1), (0x1801, 5))


@pytest.fixture
def wire() -> Iterator[Wire]:
    made = Wire()
    made.device.nmt(1)
    yield made
    made.close()


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    numbers = [signal.SIGINT] if sys.platform == "win32" else CODES  # no other is handled there
    everything = list(itertools.product(numbers, STRUCK))
    random.Random(9).shuffle(everything)
    metafunc.parametrize(("number", "struck"), everything[: metafunc.config.getoption("--signals")])


def test_what_a_signal_stops_is_put_back_and_the_program_ends_unless_it_is_control_c(
    wire: Wire, open_terminal: Open, number: signal.Signals, struck: tuple[str, int]
) -> None:
    line, step = struck
    terminal = opened(wire, open_terminal, "--yes", state="OP")

    def held() -> list[bytes]:
        with wire.at_work:
            mapping = [(0x1A00, sub_index) for sub_index in range(wire.device.value(0x1A00, 0)[0] + 1)]
            return [wire.device.value(*place) for place in (*PLACES, *mapping)]

    before = held()

    wire.at_download = lambda at: terminal.child.kill(number) if at == step else None
    if line:
        terminal.run(line)
    else:
        terminal.child.kill(number)
    if number is signal.SIGINT:
        shown = prompt(wire, "OP>")
        terminal.until(lambda: terminal.text.count(shown) == 2 and terminal.cursor_line == shown, "the next prompt")
        terminal.run("read 1018:1")
        terminal.wait("0x0000001E")
    else:
        assert terminal.ended() == CODES[number]
    assert wire.downloads >= step
    if line == MAP:
        assert "rolled back: everything is as before" in terminal.text
    assert held() == before
    assert wire.device.state is NmtState.OPERATIONAL
