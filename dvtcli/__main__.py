"""The program's start: `dvtcli`, or `python -m dvtcli`. Imports the rest where a Ctrl-C is already understood."""

from __future__ import annotations

import gc
import sys
from collections import namedtuple

#: How many new objects bring the collector of cycles. A command makes 60,000, nearly all of them code that stays; with
#: Python's own 700 it looks through them 80 times.
NEW_OBJECTS = 100_000


def entry() -> None:
    """Run dvtcli and end the process with its exit code."""
    gc.set_threshold(NEW_OBJECTS)
    # python-can imports asammdf if it is there, which takes a second; `files.recordings.mdf` does it for an .mf4
    sys.modules.setdefault("asammdf", None)  # type: ignore[arg-type]
    try:
        if None in (sys.stdin, sys.stdout, sys.stderr):
            from dvtcli.cli.view.streams import open_missing

            open_missing()
        from dvtcli.cli.main import main

        code = main()
    except KeyboardInterrupt:  # so early or so late that nothing was open
        code = 130
    # CPython kills the process at its end where a Ctrl-C once arrived in a string that it executed, as those of which
    # dataclasses are made, even if it was caught. It forgets that with the next such string, as in making this.
    namedtuple("Forgotten", ())
    gc.disable()  # the process takes all of it along: nobody need look for cycles
    gc.freeze()
    sys.exit(code)


if __name__ == "__main__":
    entry()
