"""The global options: names, defaults, ranges, and which a line may change.

`cli.global_options` parses them, `settings` reads their files.
"""

# No `from __future__ import annotations` here: `NamedTuple` would compile each annotation, at every start.
import os
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from dvtcli.errors import UsageError

#: Options only at the start of the program: a bus, a node's files, folders.
START_ONLY = frozenset(
    {
        "interface",
        "channel",
        "bitrate",
        "bus_kwargs",
        "bus",
        "node",
        "sim",
        "fault",
        "signal",
        "eds",
        "modules",
        "profile",
        "journal",
        "color",
        "ascii",
        "no_shell",
    }
)
#: What a bus can run at (bit/s): CiA 301 names 10 kbit/s to 1 Mbit/s, adapters take less.
BIT_RATES = range(1_000, 1_000_001)
#: Modules of a modular device: 0x1027 has 254 sub-indices of 16 bits.
_HIGHEST_MODULE, _MOST_MODULES = 0xFFFF, 254
#: why a question has no answer, where a terminal would give one
NO_TERMINAL = "no terminal to answer on"
#: Formats of every command, and of some.
FORMATS, SPECIAL_FORMATS = ("text", "json", "jsonl"), ("github", "junit", "sarif")
#: Formats of results that go through PDOs and objects one by one.
CASE_FORMATS = ("github", "junit")
#: `--node` for every node on the bus.
ALL_NODES = "all"
#: Options with a fixed set of words.
CHOICES = {"format": FORMATS + SPECIAL_FORMATS, "color": ("auto", "always", "never")}


class Options(NamedTuple):
    """The global options with defaults; *timeout* is the SDO time-out in seconds, *bus_share* is in %.

    A named tuple, as a dataclass would slow down `--help`.
    """

    interface: str | None = None
    channel: str | None = None
    bitrate: int | None = None
    bus_kwargs: tuple[str, ...] = ()
    bus: str | None = None
    node: int | tuple[int, ...] | str | None = None
    sim: tuple[str, ...] = ()
    fault: tuple[str, ...] = ()
    signal: tuple[str, ...] = ()
    dry_run: bool = False
    eds: str | None = None
    modules: tuple[str, ...] = ()
    profile: str | None = None
    format: str = "text"
    quiet: bool = False
    verbose: int = 0
    color: str = "auto"
    ascii: bool = False
    no_shell: bool = False
    yes: bool = False
    force: bool = False
    timeout: float = 0.5
    bus_share: int | None = None
    journal: str | None = None
    reconnect: bool = False
    no_reconnect: bool = False

    @property
    def json(self) -> bool:
        """Tell whether results are JSON documents."""
        return self.format in ("json", "jsonl")

    @property
    def adapter_settings(self) -> dict[str, str]:
        """Return the interface's own settings of `--bus-kwargs`."""
        return dict(pair.split("=", 1) for pair in self.bus_kwargs)

    @property
    def nodes(self) -> tuple[int, ...]:
        """Return the node-IDs of `--node`, in order; empty if not given, or `all`."""
        if isinstance(self.node, tuple):
            return self.node
        return (self.node,) if isinstance(self.node, int) else ()

    @property
    def every_node(self) -> bool:
        """Tell whether `--node` is `all`."""
        return self.node == ALL_NODES

    @property
    def chosen_modules(self) -> tuple[int, ...] | None:
        """Return the modules of `--modules` for the node of `--node`, else for every node; None for none."""
        return modules_of_node(self.modules, self.one_node)

    @property
    def one_node(self) -> int | None:
        """Return the node-ID of `--node` if it is a single node."""
        return self.nodes[0] if len(self.nodes) == 1 else None


def options_of(given: Mapping[str, Any]) -> Options:
    """The options *given* by name, the others as they come; UsageError for an unknown name or a wrong value."""
    unknown = sorted(given.keys() - set(Options._fields))
    if unknown:
        raise UsageError(f"unknown option {unknown[0]!r}", hint=f"options are: {', '.join(Options._fields)}")
    return Options(**{name: checked(name, value) for name, value in given.items()})


def is_repeated(name: str) -> bool:
    """Tell whether the option *name* may be repeated, and is a list in a settings file."""
    return isinstance(getattr(Options(), name), tuple)


def checked(name: str, value: Any) -> Any:
    """Convert and check *value*, perhaps text, of the option *name*; raises UsageError if invalid."""
    if name == "node":
        return _node_ids(value)
    if name == "timeout":
        return _seconds(str(value))
    if name == "bus_share":
        return _percent(value)
    if name == "bitrate":
        return bit_rate(value)
    if name in ("bus_kwargs", "modules"):
        return tuple(map(_pair if name == "bus_kwargs" else _modules, value))
    if name == "journal":
        return _folder(str(value))
    if name in CHOICES and value not in CHOICES[name]:
        raise UsageError(f"{value!r} is not one of {', '.join(map(repr, CHOICES[name]))}")
    if is_repeated(name):
        return tuple(map(str, value))
    default = getattr(Options(), name)
    return value if isinstance(default, int) else str(value)


def _folder(text: str) -> str:
    """Return the absolute path of a folder; empty for none."""
    try:
        return text and os.path.abspath(text)  # noqa: PTH100 - pathlib costs 7 ms of a --help
    except FileNotFoundError:
        raise UsageError(
            "this folder was removed", given={"journal": text}, hint="change to another folder, or give the whole path"
        ) from None


def _node_ids(value: Any) -> int | tuple[int, ...] | str:
    """Parse a node-ID, several node-IDs (`1,3,5`), or `all`."""
    if value == ALL_NODES:
        return ALL_NODES
    words = [str(item) for item in value] if isinstance(value, list | tuple) else str(value).split(",")
    try:
        found = sorted({node for word in words for node in node_range(word.strip())})
    except UsageError as wrong:
        wrong.hint = "one node-ID, several as in 1,3,5 or 1,5-9, or all"
        raise
    return found[0] if len(words) == 1 and len(found) == 1 else tuple(found)


def node_range(text: str) -> range:
    """Read a node-ID, or a range of them (`5-9`, both ends included); UsageError otherwise."""
    first, dash, last = text.partition("-")
    if not dash:
        return range(node_id(text), node_id(text) + 1)
    if node_id(first.strip()) > node_id(last.strip()):
        raise UsageError(f"{text!r} is not a range of node-IDs: {first} is above {last}")
    return range(node_id(first.strip()), node_id(last.strip()) + 1)


def node_id(text: str) -> int:
    """Read a node-ID, decimal or `0x…`, 1..127; UsageError otherwise."""
    digits = text[2:] if text.lower().startswith("0x") else text
    try:
        value = int(digits, 16 if digits != text else 10) if digits.isalnum() and digits.isascii() else -1
    except ValueError:
        value = -1
    if not 1 <= value <= 127:
        raise UsageError(f"{text!r} is not a node-ID; node-IDs are 1…127, decimal or 0x")
    return value


def bit_rate(value: int | str) -> int:
    """Return a bit rate in bit/s, given as such, as `250k` or as `1M`; UsageError if no bus runs at it."""
    text = str(value).strip().lower().removesuffix("bit/s").rstrip()
    factor = {"k": 1_000, "m": 1_000_000}.get(text[-1:], 1)
    digits = text if factor == 1 else text[:-1].rstrip()
    rate = int(digits) * factor if digits.isascii() and digits.isdigit() and len(digits) <= 7 else 0
    if rate not in BIT_RATES:
        meant = f"; did you mean {rate}k?" if factor == 1 and rate * 1_000 in BIT_RATES else ""
        raise UsageError(
            f"{str(value)!r} is not a bit rate; bit rates are {BIT_RATES[0]}…{BIT_RATES[-1]} bit/s, also 250k{meant}"
        )
    return rate


def _percent(value: Any) -> int:
    try:
        percent = int(value)
    except ValueError:
        percent = -1
    if not 1 <= percent <= 100:
        raise UsageError("a share of the bus is 1…100 %", given={"bus_share": value})
    return percent


def _pair(text: str) -> str:
    if "=" not in text:
        raise UsageError(f"a setting is KEY=VALUE, not {text!r}; each pair alone", given={"bus_kwargs": None})
    return text


def _modules(text: str) -> str:
    """Return the modules *text*, `[NODE:]1,1,2`, without blanks and in decimal."""
    node, colon, numbers = str(text).rpartition(":")
    try:
        found = [int(number, 0) for number in numbers.replace(" ", "").split(",")]
    except ValueError:
        found = [0]
    if not all(0 < number <= _HIGHEST_MODULE for number in found) or len(found) > _MOST_MODULES:
        raise UsageError(f"{text!r}: modules are numbers of the EDS, as in 1,1,2 or, of node 5, in 5:1,1,2",
                         given={"modules": None})  # fmt: skip
    return f"{f'{node_id(node)}:' if colon else ''}{','.join(map(str, found))}"


def modules_of_node(words: Iterable[str], wanted: int | None) -> tuple[int, ...] | None:
    """Return the modules in *words* (as `checked` has them) of the node *wanted*, else of every node; None: none."""
    found: dict[str, tuple[int, ...]] = {}
    for word in words:
        node, _, numbers = word.rpartition(":")
        found[node] = tuple(map(int, numbers.split(",")))
    return found.get(str(wanted), found.get(""))


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.001 <= value <= 600:
        raise UsageError("a time-out is 0.001…600 seconds", given={"timeout_s": text})
    return value


def is_file(text: str) -> bool:
    """Tell whether *text* is an existing file's path; False for invalid paths."""
    return os.path.isfile(text)  # noqa: PTH113 - Path.is_file raises OSError for a name that is too long
