"""Lines run in this process on simulated nodes, with what they printed and their exit code."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from dvtcli.cli.boundary import exit_code_of, finish_line
from dvtcli.cli.conversation import Conversation
from dvtcli.cli.lexer import split
from dvtcli.cli.main import install
from dvtcli.cli.run_line import run_words
from dvtcli.cli.scripts.script import run_script
from dvtcli.cli.view.output import Output
from dvtcli.domain.ports import CanopenBus
from dvtcli.files.profiles import builtin_path
from dvtcli.files.user_folders import user_folder
from dvtcli.simulator.device.simulated_faults import Fault
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.virtual_time import VirtualTimeBus

install()


def impatient() -> str:
    """The name of a profile of the test's own home: a CiA 301 device whose store is waited for 1 s, not 20 s."""
    folder = user_folder("config") / "profiles"
    folder.mkdir(parents=True, exist_ok=True)
    text = builtin_path("generic").read_text("utf-8")
    text, named = re.subn(r"(?m)^name = .*", 'name = "impatient"', text)
    text, waits = re.subn(r"(?m)^timeout_s = .*", "timeout_s = 1", text)
    assert (named, waits) == (1, 1)
    (folder / "impatient.toml").write_text(text, "utf-8")
    return "impatient"


def beside(devices: Sequence[StrictDevice], *faults: str) -> VirtualTimeBus:
    """*devices* as on a bus of others, that outlive a session, with *faults* in words of `--fault`; in virtual time."""
    return VirtualTimeBus(devices, faults=[Fault.parse(word) for word in faults], simulated=False)


@dataclass
class Bench:
    """A session on simulated nodes, or on a *bus* that is there, as at the prompt but without anybody to ask."""

    sim: tuple[str, ...] = ("gen4",)
    options: dict[str, Any] = field(default_factory=dict)
    bus: CanopenBus | None = None
    #: whether the simulated nodes live on the product's own bus, on which waiting takes its time
    in_real_time: bool = False
    session: Conversation = field(init=False)

    def __post_init__(self) -> None:
        bus = self.bus
        self.session = Conversation(
            Output(io.StringIO(), io.StringIO()), open_bus=None if bus is None else lambda _options: bus
        )
        if not self.in_real_time:
            self.session.simulate = partial(VirtualTimeBus, name="sim")
        self.session.start({"sim": self.sim, **self.options})
        self.session.started = True

    def __enter__(self) -> Bench:
        return self

    def __exit__(self, *_: object) -> None:
        self.session.close()

    def run(self, line: str) -> Ran:
        """Run one line as the prompt does."""

        def run() -> int:
            code = exit_code_of(self.session, lambda: run_words(split(line), self.session))
            return finish_line(self.session, code)

        return self._ran(run)

    def script(self, *lines: str, keep_going: bool = False) -> Ran:
        """Run *lines* as a script called `test.dvt`."""
        data = "\n".join(lines).encode()

        def run() -> int:
            return run_script(self.session, data, "test.dvt", keep_going=keep_going)

        return self._ran(lambda: exit_code_of(self.session, run))

    def _ran(self, run: Any) -> Ran:
        output = self.session.output
        stdout, stderr = output.stdout, output.stderr = io.StringIO(), io.StringIO()
        code = run()
        return Ran(code, stdout.getvalue(), stderr.getvalue())


@dataclass(frozen=True)
class Ran:
    """What a line ended with and said."""

    code: int
    stdout: str
    stderr: str

    def failed(self, code: int, text: str) -> None:
        """Assert that the line ended with *code*, and said *text* on stderr."""
        assert code, "a line that fails has another exit code"
        assert self.code == code, self.stderr
        assert text in self.stderr, self.stderr

    @property
    def document(self) -> dict[str, Any]:
        """The one answer on stdout, or the one error; an answer with an exit code is followed by its error."""
        document, *more = self.documents
        if more:
            (error,) = more
            assert (error["schema"], error["exit_code"]) == ("dvtcli.error/1", self.code), error
        return document

    @property
    def answer(self) -> dict[str, Any]:
        """The last answer on stdout, whether or not an error follows it; the last error where nothing was answered."""
        *_, last = [one for one in self.documents if one["schema"] != "dvtcli.error/1"] or self.documents
        return last

    @property
    def documents(self) -> list[dict[str, Any]]:
        """Every JSON document on stdout, one a line."""
        return [json.loads(line) for line in self.stdout.splitlines()]
