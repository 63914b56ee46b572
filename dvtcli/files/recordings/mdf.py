"""ASAM's measurement data, by asammdf in a child process, because a few bytes can unpack without limit.

The process writes a frame per line as JSON, then the end of the file or the error.
"""

from __future__ import annotations

import errno
import json
import os
import sys
from collections.abc import Iterator
from importlib import reload
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import can

from dvtcli.errors import UsageError
from dvtcli.files.bounded_child import die_of, go_on, limit
from dvtcli.files.recordings.recording_format import NoFrameError, RecordingFormat
from dvtcli.interpreter import how_to_install
from dvtcli.version import DISTRIBUTION

#: what asammdf may take: memory beside the file itself (bytes), of which its own libraries are 250 MB, and time of the
#: processor for the next frames (s), which beside other work is longer
_MOST_MEMORY, _CPU_S, _SECONDS = 720 << 20, 8, 24.0
#: number of frames per time limit
_FRAMES = 1000
#: maximum length of a frame's line
_MOST_LINE = 4096
_END = "end"


class MdfFormat(RecordingFormat):
    """ASAM's .mf4."""

    suffix = ".mf4"
    title = "ASAM MDF, needs asammdf"
    tells = True

    def require(self) -> None:
        """Let python-can have asammdf, which the program's start keeps from it; raise UsageError if there is none."""
        if sys.modules.get("asammdf", sys) is None:
            del sys.modules["asammdf"]
        if find_spec("asammdf") is None:
            raise UsageError(".mf4 files need asammdf", hint=how_to_install(f"{DISTRIBUTION}[mdf]"))

    def writer(self, path: Path, *, append: bool, most_bytes: int) -> Any:
        """As for every format; by a module of python-can that has asammdf."""
        from can.io import mf4

        if vars(mf4)["asammdf"] is None:
            reload(mf4)
        return super().writer(path, append=append, most_bytes=most_bytes)

    def reader(self, source: Any) -> Iterator[can.Message]:
        """Iterate over frames of the file at the path *source*. Raises NoFrameError if damaged or too costly."""
        from dvtcli.files.bounded_process import BoundedProcess, child_command

        with BoundedProcess(child_command(__name__), "asammdf") as process:
            try:
                process.stdin.write(os.fsencode(os.path.abspath(source)))  # noqa: PTH100 - it need not be there any more
                process.stdin.close()
            except OSError:  # it has ended: why is told below
                pass
            while True:
                with process.within(_SECONDS):
                    line = process.stdout.readline(_MOST_LINE)
                if not line.endswith(b"\n"):
                    raise _ended(*process.last_words(), is_late=process.lacked_time)
                said = json.loads(line)
                if said == _END:
                    return
                if isinstance(said, str):
                    raise NoFrameError(said)
                yield _message(said)


def _ended(lacked_memory: bool, how: str, *, is_late: bool) -> NoFrameError:
    if is_late:
        return NoFrameError(f"asammdf takes more than {_CPU_S} s for the next frames of it")
    if lacked_memory:
        return NoFrameError(f"asammdf takes more than {_MOST_MEMORY >> 20} MB for it")
    return NoFrameError(f"asammdf: {how}")


def _message(said: list[Any]) -> can.Message:
    time_s, can_id, extended, remote, error, fd, length, data, channel = said
    return can.Message(
        time_s, can_id, extended, remote, error, channel, dlc=length, data=bytes.fromhex(data), is_fd=fd
    )  # fmt: skip


def main() -> None:
    """Write the frames of the file whose path is on stdin to stdout, then end the process."""
    try:
        os.environ["OPENBLAS_NUM_THREADS"] = "1"  # each thread of numpy's would count as memory
        path = os.fsdecode(sys.stdin.buffer.read())
        limit(_MOST_MEMORY + os.path.getsize(path))  # noqa: PTH202 - asammdf maps the file, which counts
        go_on(_CPU_S)
        for number, said in enumerate(_told(path), 1):
            if number % _FRAMES == 0:
                go_on(_CPU_S)
            sys.stdout.write(json.dumps(said) + "\n")
        sys.stdout.flush()
    except BaseException as bug:  # noqa: BLE001 - nobody above: the parent reads of it
        die_of(bug)
    os._exit(0)


def _told(path: str) -> Iterator[list[Any] | str]:
    from can.io import MF4Reader

    try:
        for message in MF4Reader(path):  # whatever its suffix: the content tells the format
            yield [
                message.timestamp, message.arbitration_id, message.is_extended_id, message.is_remote_frame,
                message.is_error_frame, message.is_fd, message.dlc, message.data.hex(), message.channel,
            ]  # fmt: skip
    except MemoryError:
        raise
    except OSError as failed:
        if failed.errno == errno.ENOMEM:  # of a file that is mapped
            raise MemoryError from failed
        yield str(failed)[:200]
        return
    except Exception as wrong:  # noqa: BLE001 - asammdf raises what it comes across
        yield str(wrong).partition("\n")[0][:200] or type(wrong).__name__
        return
    yield _END
