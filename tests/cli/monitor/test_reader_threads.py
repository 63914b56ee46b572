"""What ends a thread that reads beside a screen is told to who takes, whatever it is: no screen shows old values on."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from io import StringIO
from typing import Any

import pytest
from prompt_toolkit.application import create_app_session
from prompt_toolkit.data_structures import Size
from prompt_toolkit.input import create_pipe_input
from prompt_toolkit.key_binding import KeyBindings
from prompt_toolkit.output.vt100 import Vt100_Output

from dvtcli.cli.conversation import Conversation
from dvtcli.cli.monitor.watch import ObjectReader
from dvtcli.cli.screen.full_screen import MappingReader, show
from dvtcli.cli.view.lines import Cell
from dvtcli.cli.view.output import Output
from dvtcli.errors import BusUnavailable, NoAnswer
from dvtcli.watch.decoder import Decoder
from tests.simulator.serve.served import wait_for


class Reading:
    """Objects and mappings whose reading ends with *faults*, one a time; the last one again and again."""

    def __init__(self, *faults: BaseException) -> None:
        self.objects = [(1, 0x6041, 0)]
        self._faults = list(faults)

    def read(self, _number: int) -> Any:
        raise self._faults.pop(0) if len(self._faults) > 1 else self._faults[0]

    def decoders(self) -> Iterator[tuple[int | None, Decoder]]:
        yield 1, Decoder()
        raise self._faults[0]


def test_an_object_that_cannot_be_read_as_nobody_foresaw_ends_the_reading_aloud() -> None:
    reader = ObjectReader(Reading(NoAnswer("no answer", node=1), ZeroDivisionError("a bug")), 0.001)  # type: ignore[arg-type]
    wait_for(lambda: not reader._thread.is_alive(), "the end of the thread")
    assert [str(found) for _, _, found in reader.take()] == ["no answer"]
    for _ in range(2):
        with pytest.raises(ZeroDivisionError, match="a bug"):
            reader.take()
    reader.stop()


def test_mappings_that_cannot_be_read_as_nobody_foresaw_end_the_reading_aloud() -> None:
    reader = MappingReader(Reading(ZeroDivisionError("a bug")))  # type: ignore[arg-type]
    wait_for(lambda: not reader.is_reading, "the end of the reading")
    with pytest.raises(ZeroDivisionError, match="a bug"):
        reader.news()


def test_a_bus_that_is_gone_is_the_listeners_to_say() -> None:
    gone = Reading(BusUnavailable("gone"))
    objects, mappings = ObjectReader(gone, 0.001), MappingReader(gone)  # type: ignore[arg-type]
    wait_for(lambda: not (objects._thread.is_alive() or mappings.is_reading), "the end of both")
    assert objects.take() == []
    mappings.news()


class Failing:
    """A screen that fails when it takes what is new for the third time."""

    def __init__(self) -> None:
        self._takings = 0
        self.left = False

    def gather(self) -> None:
        self._takings += 1
        if self._takings > 2:
            raise ZeroDivisionError("a bug")

    def lines(self, _columns: int, _rows: int) -> Iterable[list[Cell]]:
        return [[Cell("drawn")]]

    def leave(self) -> None:
        self.left = True


def test_it_ends_the_screen() -> None:
    terminal, screen = StringIO(), Failing()
    with create_pipe_input() as typed:
        output = Vt100_Output(terminal, lambda: Size(24, 80), term="xterm")
        with create_app_session(typed, output), pytest.raises(ZeroDivisionError, match="a bug"):
            show(Conversation(Output()), screen, KeyBindings(), 3.0)
    assert screen.left
    assert terminal.getvalue().rpartition("\x1b[?1049h")[2].count("\x1b[?1049l") == 1
