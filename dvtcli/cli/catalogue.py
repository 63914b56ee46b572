"""The commands by task with a line each, without importing any; suggestions for wrong names."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

#: All commands by task, in the order of help: name, and one-line help.
COMMANDS: dict[str, dict[str, str]] = {
    "Begin": {
        "tour": "Take a guided tour on a simulated node: each step is explained and carried out.",
        "doctor": "Check the set-up: packages, settings, interfaces, bus, node, journals.",
        "trust": "Trust a project's dvtcli.toml, with all its settings, until it changes.",
        "help": "Show all commands by task, one command with its examples, or a topic.",
        "exit": "Leave the prompt, or end a script here.",
    },
    "Find nodes": {
        "scan": "Find the nodes on the bus, by heartbeats and by asking each node-ID for its device type.",
        "bitrate": "Find the bit rate of a bus by listening.",
        "lss": "Find nodes without a node-ID, assign and store node-IDs, change the bit rate, by LSS (CiA 305).",
        "node": "Show a node's identity; at the prompt and in scripts `node ID` also selects it.",
        "nmt": "Send an NMT command (start, stop, preop, reset-node, reset-comm) and check that it worked.",
        "login": "Log in to a device that asks for an access level; the passcode is never shown or kept.",
        "profiles": "List the device profiles, or show one with its sources; show needs of single devices.",
        "learn": "Test what a device accepts, roll everything back, and write a profile and a simulated family.",
        "eds": "Check, show and convert EDS, DCF, XDD and XDC files; keep a library of them.",
    },
    "See": {
        "pdo": "List a node's PDOs, or show a PDO with its frame picture.",
        "objects": "Search the object dictionary: names, types, access, mappable objects.",
        "read": "Read objects by SDO upload and decode them: one, several, or repeatedly.",
        "faults": "Show a node's error register, error history and EMCY messages; clear the history.",
        "monitor": "Show the traffic on the bus, decoded, with rate, jitter, minimum and maximum; in a pipe as JSON.",
        "watch": "Watch chosen objects and PDOs on a full screen: values, changes, ages and trends.",
        "decode": "Decode a recording: as lines, as JSON, or as a table with one column a signal.",
        "log": "Record the bus as .asc .blf .log .trc .mf4 .pcapng, or decoded as .csv .parquet .jsonl.",
    },
    "Frames": {
        "explain": "Explain a frame bit by bit: its sender, its content, its values.",
        "trace": "Show the last exchange with the nodes, frame by frame.",
        "send": "Send frames, once or repeatedly, after an explanation of each frame.",
        "replay": "Send a recording again: at its own speed, faster or slower, whole or in part.",
    },
    "Change PDOs": {
        "map": "Map objects into a PDO: check, disable, write, enable, read back; roll back on failure.",
        "edit": "Edit the PDOs of a node or a file on the full screen, see the rules, then write like `map`.",
        "set": "Set communication parameters of a PDO: COB-ID, transmission type, inhibit time, event timer.",
        "enable": "Enable PDOs: clear bit 31 of their COB-IDs.",
        "disable": "Disable PDOs: set bit 31 of their COB-IDs; the mapping stays.",
        "clear": "Clear PDOs: no mapping, and disabled.",
        "vpdo": "List the virtual PDOs inside a node, or connect a pin to an object.",
        "write": "Write an object by SDO download, under the rules of the command for it.",
    },
    "Check and keep": {
        "verify": "Read PDOs back and compare with this session's values, or with a FILE; --frame checks a real frame.",
        "sync": "Send SYNC messages and show the frames that answer, or find the SYNC producer.",
        "store": 'Store the node\'s values, so that they survive a power cycle (0x1010 "save").',
        "restore": 'Restore the node\'s defaults (0x1011 "load").',
        "undo": "Undo the last change or all of this session's, or restore an automatic backup.",
        "recover": "Roll back an interrupted change to the old configuration in its journal, or close the journal.",
        "download": "Update a device's firmware (program download, CiA 302-3) and check that it runs.",
    },
    "Whole devices": {
        "backup": "Save everything that can be read from a device to a file.",
        "compare": "Compare a whole device, or a file, with a file; exit code 3 if a setting differs.",
        "clone": "Copy a device's configuration from a file of another device of the same product.",
    },
    "Networks": {
        "plan": "Show what must be written to bring a network to the state in a file; writes nothing.",
        "diff": "Compare a network with its file; exit code 3 if it differs.",
        "apply": "Bring a network to the state in a file: all nodes, or none.",
        "link": "Connect RPDOs to a TPDO of another node.",
        "unlink": "Disconnect RPDOs from a TPDO.",
        "load": "Compute the worst-case bus load and response times, and compare with the traffic on the bus.",
        "report": "Draw a network as an HTML page with wiring, layouts, load and findings, or its wiring as SVG or "
        "Graphviz.",
    },
    "Scripts and files": {
        "run": "Run a script: every line is parsed before the first line runs.",
        "tcl": "Run a line of Tcl with the DVT's words; alone, at the prompt, all lines until `exit`.",
        "save": "Save this session's changes as a script.",
        "alias": "List, set or remove your own words for lines of the prompt.",
        "require": "Stop a script before any write if the node is another device, or its power stage is on.",
        "check": "Check network files, a running network, or recordings: CAN-IDs, layouts, SYNC, heartbeats, load.",
        "export": "Write a node's configuration to a file: a network file, a DCF, an XDC, a DBC file.",
        "import": "Write a whole network, or a folder of EDS files, to a network file.",
        "plot": "Draw signals of a recording: on the terminal, or as a picture.",
    },
    "Programs around": {
        "sim": "Serve simulated nodes to other programs, on a socketcand port or on a bus.",
        "gateway": "Serve the bus to programs that speak CiA 309-3, a gateway in ASCII lines over TCP.",
        "completion": "Print the script for Tab completion in a shell.",
    },
}
#: The tasks in their usual order.
TASKS = tuple(COMMANDS)
_SUMMARIES = {name: line for group in COMMANDS.values() for name, line in group.items()}
_NAMES = sorted(_SUMMARIES)


def command_names() -> list[str]:
    """Return the names of all commands, sorted."""
    return list(_NAMES)


def summary(name: str) -> str:
    """Return a command's one-line help. Raises KeyError if unknown."""
    return _SUMMARIES[name]


def task_sections() -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """Iterate over tasks with their commands and one-line helps."""
    for task, commands in COMMANDS.items():
        yield task, list(commands.items())


#: width of help (columns)
_WIDTH = 80


def task_rows() -> list[str]:
    """Return the names of all commands by task, in rows of at most 80 columns."""
    rows: list[str] = []
    width = max(map(len, TASKS))
    for task, commands in COMMANDS.items():
        names = fill_rows(list(commands), _WIDTH - width - 4)
        rows += [f"  {task if row is names[0] else '':<{width}}  {row}" for row in names]
    return rows


def fill_rows(names: Sequence[str], width: int) -> list[str]:
    """Arrange *names* in rows of at most *width* columns."""
    rows = [""]
    for name in names:
        longer = f"{rows[-1]}  {name}" if rows[-1] else name
        if len(longer) > width and rows[-1]:
            rows.append(name)
        else:
            rows[-1] = longer
    return rows


#: Words of other programs, with the equivalent command.
_ALSO = {"quit": "exit"}
_A_PDO = r"(?i)(?:\d{1,3}:)?[tr]pdo\d{1,3}"


def meant(words: Sequence[str]) -> list[str]:
    """A line's *words* with the command that is meant: `MAP` is `map`, `quit` is `exit`, a PDO alone is shown."""
    name, *rest = words
    if not rest and re.fullmatch(_A_PDO, name):
        return ["pdo", name]
    lower = _ALSO.get(name.lower(), name.lower())
    return [lower if lower in command_names() else name, *rest]


_TCL_WORDS = frozenset(("proc", "puts", "foreach", "for", "while", "if", "expr", "incr", "catch", "after"))


#: How much of a word must be a command's (0…1) for that to be offered: `trace` and `history` are no `store`.
_NEAR = 0.7
#: In words up to so many letters a single one is much: `mpa` is `map`.
_SHORT = 3


def with_a_swap(word: str) -> Iterator[str]:
    """Iterate over *word* with each pair of neighbours swapped (`mpa` may be `map`); nothing for a short word."""
    if len(word) >= _SHORT:
        for at in range(len(word) - 1):
            yield word[:at] + word[at + 1] + word[at] + word[at + 2 :]


def unknown_command(name: str, others: Sequence[str] = ()) -> str:
    """Return the message for a word that is neither a command nor in *others*."""
    if name.lower() in ("q", "bye", "logout"):
        return f"unknown command {name!r}; did you mean 'exit'?"
    if re.fullmatch(_A_PDO, name):
        return f"unknown command {name!r}: pdo {name} shows it, map {name} OBJECT... sets its mapping"
    if name in _TCL_WORDS:
        script = "a Tcl script is a file whose name ends in .tcl"
        return f"unknown command {name!r}: it is a Tcl command, at the prompt `tcl {name} …`; {script}"
    near = nearest_command(name, others)
    return f"unknown command {name!r}" + (f"; did you mean {near!r}?" if near else "; help lists them")


def nearest_command(name: str, others: Sequence[str] = ()) -> str | None:
    """Return the command, DVT word or word of *others* that *name* is near to; None if none is."""
    from difflib import get_close_matches

    from dvtcli.cli.dvt.words import WORDS

    known = [*command_names(), *others, *WORDS]
    swapped = next((word for word in with_a_swap(name.lower()) if word in known), None)
    close = get_close_matches(name.lower(), known, n=1, cutoff=_NEAR if len(name) > _SHORT else 0.6)
    return swapped or next(iter(close), None)
