"""Ways to send something past the plan (law 2), and from a command that says it only reads."""

from __future__ import annotations

from tests.house.laws.breaks.way import Break, in_a_function

BREAKS = [
    Break("senders", "cli/commands/map.py", in_a_function("node.sdo.download(0x1800, 1, b'')")),
    Break("senders", "operations/h.py", in_a_function("write = node.sdo.download", "write(0x1800, 1, b'')")),
    Break("senders", "cli/commands/pdo.py", in_a_function("session.bus.send_nmt(1, 0)")),
    Break("senders", "operations/session/steady_listener.py", in_a_function("bus.send(node)")),
    Break("senders", "files/recordings/recording_file.py", in_a_function("map(bus.send, node)")),
    Break("senders", "cli/dvt/words.py", in_a_function('getattr(node.sdo, "download")(0x1017, 0, b"")')),
    Break("senders", "operations/helper.py", in_a_function("bus.canopen().network.send_message(0, b'')")),
    Break("senders", "cli/commands/map.py", in_a_function("vars(type(node.sdo))[node](0x1017, 0, b'')")),
    Break("senders", "cli/commands/map.py", in_a_function("getattr(node.sdo, node.word)(0x1017, 0, b'')")),
    Break(
        "senders",
        "operations/changes/change.py",
        in_a_function("match node:", "    case Sdo(download=write):", "        write(1)"),
    ),
    Break("senders", "operations/changes/change.py", "from dvtcli.device.change.transaction import Transaction"),
    Break("senders", "operations/pdos/helper.py", in_a_function("from dvtcli.device import resets")),
    Break("senders", "cli/dvt/words.py", in_a_function("import dvtcli.device.learn.probing")),
    Break("senders", "operations/helper.py", in_a_function("session.canopen(1).nmt.state = 'OPERATIONAL'")),
    Break("senders", "operations/nodes/helper.py", "import dvtcli.device.store.store_parameters as keeping"),
    Break("senders", "operations/nodes/helper.py", "from dvtcli.device.store.store_parameters import *"),
    Break("senders", "operations/h.py", "from dvtcli.device.store.store_parameters import write_signature as chosen"),
    Break("senders", "operations/nodes/helper.py", "from dvtcli.device.store import store_parameters"),
    Break("senders", "operations/h.py", "from dvtcli.operations.changes.store_restore import write_signature"),
    Break("senders", "operations/nodes/helper.py", "from dvtcli.operations.changes.store_restore import *"),
    Break("senders", "operations/nodes/helper.py", "from dvtcli.operations.nodes.command_nmt import *"),
    Break(
        "senders",
        "operations/nodes/helper.py",
        in_a_function("from dvtcli.operations.nodes import command_nmt as one", "one.send_reset(node)"),
    ),
    Break("senders", "operations/nodes/helper.py", "from dvtcli.device.seen_state import seen_state"),
    Break(
        "senders",
        "operations/nodes/helper.py",
        in_a_function('importlib.import_module("dvtcli.device.store.store_parameters").write_signature(node)'),
    ),
    Break(
        "senders",
        "operations/nodes/helper.py",
        in_a_function(
            "import dvtcli.device.change.transaction", "dvtcli.device.store.store_parameters.write_signature(node)"
        ),
    ),
    Break("senders", "cli/commands/map.py", in_a_function("s = node.sdo", "getattr(s, node.word)(1)")),
    Break("senders", "cli/commands/map.py", in_a_function("s: object = node.sdo", 'getattr(s, "down" + "load")(1)')),
    Break("senders", "cli/commands/map.py", in_a_function("g = getattr", 'g(node.sdo, "download")(1)')),
    Break(
        "senders",
        "cli/commands/map.py",
        in_a_function("from operator import methodcaller as m", 'm("down" + "load", 1)(node.sdo)'),
    ),
    Break("senders", "cli/commands/map.py", in_a_function('node.sdo.__class__.__dict__["down" + "load"](node.sdo, 1)')),
    Break("senders", "cli/commands/map.py", in_a_function("dict(inspect.getmembers(node.sdo))[node](1)")),
    Break(
        "effects",
        "cli/commands/read.py",
        in_a_function("from dvtcli.operations.changes import store_restore as it", "it.store_settings(session)"),
    ),
    Break(
        "effects",
        "cli/commands/scan.py",
        in_a_function("from dvtcli.operations.nodes import command_nmt as it", "it.command_nmt(session, 1)"),
    ),
    Break(
        "effects",
        "cli/commands/objects.py",
        in_a_function("import dvtcli.operations.changes.change as it", "it.configure(session, node, {})"),
    ),
    Break("effects", "cli/commands/trace.py", in_a_function("from dvtcli.operations.frames.send_frames import *")),
    Break("effects", "cli/commands/faults.py", in_a_function("from dvtcli.operations.lss.lss_find import lss_scan")),
]
