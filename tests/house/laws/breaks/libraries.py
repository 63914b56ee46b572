"""Ways to libraries, and out of the process, from rooms that have nothing to do with them (law 1)."""

from __future__ import annotations

from tests.house.laws.breaks.way import Break, in_a_function

BREAKS = [
    Break("libraries", "device/node.py", "import canopen"),
    Break("libraries", "operations/changes/change.py", in_a_function("import click")),
    Break("libraries", "cli/commands/map.py", in_a_function("from can import Bus")),
    Break("libraries", "domain/plan.py", "from ruamel.yaml import YAML"),
    Break("libraries", "watch/decoder.py", in_a_function('return importlib.import_module("can.interfaces")')),
    Break("libraries", "cli/view/lines.py", "from prompt_toolkit.formatted_text import HTML"),
    Break("libraries", "device/node.py", in_a_function("load = importlib.import_module", 'return load("canopen")')),
    Break("libraries", "device/node.py", in_a_function('return sys.modules["can"]')),
    Break("libraries", "device/node.py", in_a_function('__import__(name="can")')),
    Break("libraries", "device/node.py", in_a_function('exec("import can")')),
    Break("libraries", "files/dbc.py", in_a_function('import_module(__package__.partition(".")[0] + ".cli.main")')),
    Break("libraries", "cli/commands/map.py", "from dvtcli.bus.python_can import can"),
    Break("libraries", "cli/commands/map.py", "import rich"),
    Break("libraries", "files/pdo_yaml.py", in_a_function("import requests")),
    Break("libraries", "operations/changes/change.py", in_a_function("import cantools")),
    Break(
        "libraries",
        "files/recordings/recording_file.py",
        in_a_function("import socket", "socket.socket().sendto(b'', node)"),
    ),
    Break("libraries", "operations/helper.py", "from subprocess import run"),
    Break("libraries", "device/node.py", in_a_function("import signal", "signal.signal(2, signal.SIG_IGN)")),
    Break("libraries", "operations/changes/change.py", in_a_function("import urllib.request")),
    Break("libraries", "operations/changes/change.py", in_a_function("import _socket")),
    Break("libraries", "operations/changes/change.py", in_a_function("import telnetlib")),
    Break("libraries", "operations/changes/change.py", in_a_function("import zipimport")),
    Break(
        "libraries",
        "operations/changes/change.py",
        in_a_function("from dvtcli.bus import python_can as pc", "return pc.can.Bus()"),
    ),
    Break("libraries", "device/node.py", in_a_function('return sys.modules.get("can")')),
    Break(
        "libraries",
        "device/node.py",
        in_a_function("import importlib", 'return getattr(importlib, "import_module")("can")'),
    ),
    Break(
        "libraries",
        "device/node.py",
        in_a_function("from importlib.machinery import SourceFileLoader as load", "return load('can', node)"),
    ),
    Break(
        "libraries",
        "device/node.py",
        in_a_function(
            "from importlib.util import spec_from_file_location", "return spec_from_file_location('x', node)"
        ),
    ),
    Break("libraries", "operations/h.py", in_a_function("import os", "os.posix_spawn('/bin/ls', [], dict())")),
    Break("libraries", "operations/changes/change.py", in_a_function("from os import popen as ask", "ask('ls')")),
    Break("libraries", "operations/changes/change.py", in_a_function("os.system('ls')")),
]
