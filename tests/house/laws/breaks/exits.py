"""Ways to end the program anywhere, and to make errors of one's own (law 7)."""

from __future__ import annotations

from tests.house.laws.breaks.way import Break, in_a_function

BREAKS = [
    Break("exits", "cli/commands/map.py", in_a_function("c = ctx", "c.exit(0)")),
    Break("exits", "cli/commands/map.py", in_a_function("c = click.get_current_context()", "c.exit(0)")),
    Break("exits", "device/node.py", in_a_function("stop = KeyboardInterrupt()", "raise stop")),
    Break("errors", "device/node.py", in_a_function("e = RuntimeError('x')", "raise e")),
    Break("errors", "device/node.py", "T = type\nOdd = T('Odd', (ValueError,), {})"),
    Break("errors", "device/node.py", "import types\nOdd = types.new_class('Odd', (ValueError,))"),
    Break("exits", "cli/commands/map.py", in_a_function("raise SystemExit(3)")),
    Break("exits", "operations/changes/change.py", in_a_function("sys.exit(0)")),
    Break("exits", "cli/prompt/loop.py", "from sys import exit as leave"),
    Break("exits", "device/node.py", in_a_function("raise SystemExit")),
    Break("exits", "files/dbc.py", in_a_function("os._exit(0)")),
    Break("exits", "cli/scripts/script.py", in_a_function("quit()")),
    Break("exits", "cli/commands/map.py", in_a_function("ctx.exit(0)")),
    Break("exits", "cli/commands/map.py", in_a_function("raise click.exceptions.Exit(0)")),
    Break("exits", "cli/commands/map.py", in_a_function("raise click.Abort")),
    Break("exits", "device/node.py", in_a_function("import sys as system", "system.exit(0)")),
    Break("exits", "device/node.py", in_a_function("leave = sys.exit", "leave(0)")),
    Break("exits", "device/node.py", in_a_function("error = SystemExit(0)", "raise error")),
    Break("exits", "device/node.py", in_a_function("raise KeyboardInterrupt")),
    Break("exits", "device/node.py", in_a_function("os.execv('/bin/true', [])")),
    Break("exits", "operations/changes/change.py", in_a_function("atexit.register(node)")),
    Break("errors", "device/node.py", "class Odd(DvtcliError): ..."),
    Break("errors", "operations/helper.py", "class Odd(Exception): ..."),
    Break("errors", "cli/commands/map.py", "class MapError(click.ClickException): ..."),
    Break("errors", "files/dbc.py", "class Odd(InputFileError): ..."),
    Break("errors", "bus/opening.py", "class Odd(KeyboardInterrupt, object): ..."),
    Break("errors", "device/node.py", "Odd = type('Odd', (Exception,), {})"),
    Break("errors", "device/node.py", "Base = Exception\nclass Odd(Base): ..."),
    Break("errors", "device/node.py", "class Odd(StopIteration): ..."),
    Break("errors", "device/node.py", "from dvtcli.errors import NoAnswer as Silent\nclass Odd(Silent): ..."),
    Break("errors", "device/node.py", in_a_function("raise RuntimeError('no')")),
    Break("exits", "cli/commands/map.py", in_a_function("import os", "getattr(os, '_exit')(0)")),
    Break("errors", "device/node.py", in_a_function("raise Warning('x')")),
]
