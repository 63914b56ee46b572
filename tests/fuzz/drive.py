"""Runs inputs through targets: each is made from its target, a seed and its number, so that it can be made again.

python -m tests.fuzz.drive TARGET SEED NUMBER      one input again
python -m tests.fuzz.drive TARGET FILE             an input that was kept
"""

from __future__ import annotations

import os
import signal
import sys
import tempfile
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from time import process_time
from types import FrameType

from tests.files.test_eds_any import SAMPLE
from tests.fuzz.grammar import make
from tests.fuzz.targets import TARGETS

#: CPU seconds after which an input that is a few hundred bytes long counts as a finding, and when it is cut off
SLOW_S, HANGS_S = 3.0, 60
#: of a thousand inputs, how many each target gets: what is cheap or matters most gets more
SHARES = {
    "eds": 60, "dcf": 50, "profile_toml": 50, "defaults": 50, "script": 50, "line": 90, "syntax": 50,
    "journal": 100, "fault": 60, "sdo_client": 140, "sdo_server": 75, "view": 25, "device": 10,
    "network": 50, "dbc": 2, "recording": 39, "mdf": 1, "values": 20, "xdd": 20, "gateway_line": 30, "concise": 13,
    "history": 5, "kept": 10,
}  # fmt: skip
assert SHARES.keys() - TARGETS.keys() <= {"mdf"}  # without asammdf
assert sum(SHARES.values()) == 1000


class Hangs(BaseException):
    """An input took too long; no reader may catch it."""


@dataclass(frozen=True)
class Found:
    """An input that a target does not stand."""

    target: str
    seed: str
    number: int
    data: bytes
    trace: str

    def __str__(self) -> str:
        again = f"python -m tests.fuzz.drive {self.target} {self.seed} {self.number}"
        return f"{self.trace}\ninput: {self.data[:2000]!r}\nagain: {again}"


def made(target: str, seed: str, number: int) -> bytes:
    """Input *number* of *target* under *seed*."""
    return make(target, Random(f"{target}:{seed}:{number}"))


def run(target: str, seed: str, numbers: range) -> Iterator[Found | None]:
    """Run the inputs *numbers* of *target*; one item each, None where all is well."""
    for number in numbers:
        data = made(target, seed, number)
        trace = tried(target, data)
        yield None if trace is None else Found(target, seed, number, data, trace)


def tried(target: str, data: bytes) -> str | None:
    """What *target* makes of *data*: None where all is well, else a traceback or that it is slow."""
    began_s = process_time()
    try:
        with _watched():
            TARGETS[target](data)
    except (Exception, Hangs):  # noqa: BLE001 - whatever it is, it is what we look for
        return traceback.format_exc()
    took_s = process_time() - began_s
    return f"took {took_s:.1f} s" if took_s > SLOW_S else None


@contextmanager
def _watched() -> Iterator[None]:
    """Stop an input that hangs, where the system can."""
    if not hasattr(signal, "setitimer"):
        yield
        return
    before = signal.signal(signal.SIGALRM, _too_long)
    signal.setitimer(signal.ITIMER_REAL, HANGS_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def _too_long(_number: int, _frame: FrameType | None) -> None:
    raise Hangs(f"more than {HANGS_S} s")


@contextmanager
def workshop() -> Iterator[Path]:
    """A folder of its own to work in, with the files that lines name, and nothing of the user's."""
    before = Path.cwd()
    memory = "/dev/shm" if Path("/dev/shm").is_dir() else None  # noqa: S108 - a folder of its own in it
    with tempfile.TemporaryDirectory(dir=memory) as name:
        folder = Path(name)
        (folder / "good.eds").write_bytes(SAMPLE)
        (folder / "odd.eds").write_bytes(SAMPLE.replace(b"=", b"\0", 9))
        (folder / "journal.json").write_bytes(made("journal", "workshop", 5))
        (folder / "self.dvt").write_text("pdo\nrun self.dvt\n")
        kept = {key: os.environ.get(key) for key in ("XDG_DATA_HOME", "XDG_STATE_HOME", "XDG_CONFIG_HOME", "HOME")}
        os.environ.update(dict.fromkeys(kept, name))
        os.chdir(folder)
        try:
            yield folder
        finally:
            os.chdir(before)
            for key, value in kept.items():
                if value is None:
                    del os.environ[key]
                else:
                    os.environ[key] = value


def main(target: str, *rest: str) -> int:
    """Run one input again and say what comes of it."""
    data = Path(rest[0]).read_bytes() if len(rest) == 1 else made(target, rest[0], int(rest[1]))
    print(repr(data))
    with workshop():
        trace = tried(target, data)
    print(trace or "all is well")
    return 0 if trace is None else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
