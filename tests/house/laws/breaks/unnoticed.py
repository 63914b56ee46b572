"""Ways to break a law that pass it, each with why; a test sees that they still do, so what is mended leaves here."""

from __future__ import annotations

from tests.house.laws.breaks.way import Break, in_a_function

_IN_PIECES = "a name that is put together while it runs: nobody does so by accident, and a reader stumbles over it"
_CALLED = "whether what is called says anything cannot be seen from its name; what users read is tested by running it"
_NARROW = (
    "legal: a failure that is named may mean nothing, such as a node that is not there; the test of its room says so"
)
_INNER = "legal: a wrong value inside a room; who calls says it as one of our errors, and a bug is told by the boundary"
_RUNTIME = "what a container holds, or a class says of itself, is known when it runs"


def _pass(law: str, file: str, why: str, *lines: str) -> tuple[Break, str]:
    return Break(law, file, in_a_function(*lines)), why


def _try(why: str, kinds: str, *then: str) -> tuple[Break, str]:
    return _pass(
        "swallowing", "device/node.py", why, "try:", "    node()", f"except {kinds}:", *(f"    {one}" for one in then)
    )


#: a way -> why no law looks for it
UNNOTICED: dict[Break, str] = dict(
    [
        _pass("independence", "simulator/device/strict_device.py", _IN_PIECES, 'return "".join(["profile", ".toml"])'),
        _pass("libraries", "device/node.py", _IN_PIECES, 'return __builtins__["__import__"]("ca" + "n")'),
        _pass("libraries", "device/node.py", _IN_PIECES, 'return vars(importlib)["import_module"]("canopen")'),
        _pass("vendors", "device/node.py", _IN_PIECES, 'return node.name == "".join(["gen", "4"])'),
        _pass("vendors", "device/node.py", _IN_PIECES, 'return node.name == "gen%d" % 4'),
        _pass("vendors", "device/node.py", _IN_PIECES, 'return node.name == "nevces"[::-1]'),
        _pass("vendors", "device/node.py", _IN_PIECES, 'return node.vendor_id == int("1E", 16)'),
        _pass(
            "vendors",
            "device/node.py",
            "a maker without a family here, and no list has all",
            'return node.name == "Danfoss"',
        ),
        _pass("vendors", "device/node.py", "nothing says that it is an identity", "return OLD.get((30, 1))"),
        _pass("buses", "operations/changes/change.py", _RUNTIME, 'return isinstance(node.bus, KINDS["real"])'),
        _pass("buses", "operations/changes/change.py", _RUNTIME, "return type(node.bus) == kinds.python_can"),
        _pass(
            "buses", "operations/changes/change.py", "no bus says a kind of itself", 'return node.bus.kind == "twin"'
        ),
        _pass("exits", "cli/commands/map.py", _RUNTIME, "raise BaseException.__subclasses__()[0](0)"),
        _pass("errors", "device/node.py", _INNER, 'raise ValueError("x")'),
        _pass("errors", "device/node.py", _INNER, 'raise OSError("gone")'),
        _pass(
            "errors", "device/node.py", "what a base leaves to others, and what cannot be", "raise NotImplementedError"
        ),
        _try(_NARROW, "NoAnswer", "pass"),
        _try(_NARROW, "(NoAnswer, BusUnavailable)", "return 0"),
        _try(_NARROW, "(OSError, ValueError, RuntimeError, LookupError)", "pass"),
        _try(_CALLED, "DvtcliError", 'len("x")', "return 0"),
        _try(_CALLED, "DvtcliError as error", "str(error)"),
        _try(_CALLED, "KeyboardInterrupt", "node()"),
        _try(_RUNTIME, "tuple([Exception])", "pass"),
        _pass("swallowing", "device/node.py", _CALLED, "with ExitStack() as stack:", "    stack.push(lambda *_: True)"),
        _pass(
            "senders",
            "cli/commands/map.py",
            "no SDO client of ours is a table, as canopen's is",
            "node.sdo[0x1800][1].raw = 5",
        ),
        (Break("laziness", "domain/datatypes.py", "T = (lambda: open('x'))()"), _IN_PIECES),
        (Break("errors", "device/node.py", "def base(): return ValueError\nclass Odd(base()): ..."), _RUNTIME),
    ]
)
