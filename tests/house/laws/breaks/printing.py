"""Ways to print and to ask past the view (law 8)."""

from __future__ import annotations

from tests.house.laws.breaks.way import Break, in_a_function

BREAKS = [
    Break("printing", "operations/changes/change.py", in_a_function("open(1, 'w', closefd=False).write('x')")),
    Break("printing", "operations/changes/change.py", in_a_function("os.fdopen(1, 'w').write('x')")),
    Break("printing", "operations/changes/change.py", in_a_function("os.writev(1, [b'x'])")),
    Break("printing", "operations/changes/change.py", in_a_function("Path('/dev/stdout').write_text('x')")),
    Break("printing", "operations/changes/change.py", in_a_function("breakpoint()")),
    Break("printing", "operations/changes/change.py", in_a_function('print("done")')),
    Break("printing", "cli/commands/map.py", in_a_function("click.echo(1)")),
    Break("printing", "device/node.py", in_a_function('sys.stderr.write("oops")')),
    Break("printing", "device/node.py", in_a_function("map(print, node)")),
    Break("printing", "device/node.py", "from builtins import print as say\n" + in_a_function("say(1)")),
    Break("printing", "device/node.py", in_a_function("out = sys.stdout", "out.write('x')")),
    Break("printing", "device/node.py", in_a_function("json.dump({}, sys.stdout)")),
    Break("printing", "device/node.py", in_a_function("os.write(1, b'x')")),
    Break("printing", "device/node.py", in_a_function('open("/dev/tty", "w").write("x")')),
    Break("printing", "device/node.py", in_a_function("return input('sure? ')")),
    Break("printing", "device/node.py", in_a_function("logging.warning('x')")),
    Break("printing", "cli/commands/map.py", in_a_function("return click.confirm('sure?')")),
    Break("printing", "cli/commands/map.py", in_a_function("session.output.stdout.write('x')")),
    Break("printing", "operations/changes/change.py", in_a_function("getattr(sys, 'stdout').write('x')")),
    Break("printing", "operations/changes/change.py", in_a_function("help(node)")),
]
