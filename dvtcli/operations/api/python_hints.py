"""What a command's user is told to do next, in calls and arguments of this API: `pdo --all` is `node.pdos()`.

Knows the names of calls and arguments. Does not know who says it, nor why.
"""

from __future__ import annotations

import re

#: options of commands -> what they are called here, where that is another word
_ARGUMENTS = {
    "timer": "timer_ms",
    "inhibit": "inhibit_ms",
    "timeout": "timeout_s",
    "fault": "faults",
    "signal": "signals",
    "sim": "nodes",
    "all": "everything",
    "as": "as_type",
    "for": "for_s",
    "every": "every_s",
    "with": "services",
}
#: options that have one letter -> the argument; the long form may stand beside it
_LETTERS = {"b": "bitrate", "c": "channel", "i": "interface", "n": "node_id", "p": "profile"}
_SENTENCES = {
    "-i socketcan -c can0": "dvtcli.connect('socketcan', 'can0')",
    "scan finds the nodes; `node ID` selects one at the prompt and in scripts, -n ID on the command line":
        "`scan` finds the nodes",
    "pdo, read, node, faults, store, and plan, diff, verify, apply and import of a file take several":
        "`node ID` gives one",
    "-n 3,4,5 names several": "`node ID` gives each",
    "without -n it is": "without `dvtcli -n` it is",
    "lss scan and scan show": "`lss scan` and `scan` show",
    "lss select vendor=… product=… revision=… serial=…, or name these behind the node-ID":
        "`lss select ADDRESS`, or give the address besides the node-ID",
    "`save FILE.dvt`": "keep `save`",
    "save NAME.dvt writes a script": "`save` answers a script",
    "save --history writes": "`bus.script(history=True)` has",
    "map or set it first": "`map` or `set` it first",
    "what map or set did before it, at the prompt or in one script": "what `map` or `set` did before it",
    "at the prompt, or in a script, behind the line it is about; -vv shows the frames of one command":
        "`dvtcli -vv` before a command shows its frames",
    "-v shows": "`dvtcli -v` shows",
    "--identity vendor=…,product=…": "VENDOR PRODUCT",
    "--identity vendor=0x1E,product=0x0705302D": "vendor=0x1E, product=0x0705302D",
    "small letters, digits, - and _: learn --save": "small letters, digits, - and _: `learn` save=",
    "--no-heartbeat leaves": "heartbeat=False leaves",
    "clear a TPDO first, or map into one by name: map tpdo1 …":
        "`clear` a TPDO first, or `map tpdo1 …` into one by name",
    "--listen 127.0.0.1:60000": "`dvtcli gateway --listen 127.0.0.1:60000`",
    "--as os shows": "as_type='os' shows",
    "--for NODE, by": "for=NODE, by",
    "plan --to-manager makes": "`bus.plan(FILE, to_manager=ID)` makes",
    "plan --include makes": "`bus.plan(FILE, include=…)` makes",
    "plan --trust-stamp makes": "`bus.plan(FILE, trust_stamp=True)` makes",
    "pdo edit": "dvtcli pdo edit",
    "report NAME.html, NAME.svg or NAME.dot": "its target is NAME.html, NAME.svg or NAME.dot",
    "nmt preop all": "`nmt preop` for each node",
    "`sync --period 20 --count 100` sends": "`bus.sync(100, period_ms=20)` sends",
    "--compare takes a name": "compare= takes a name",
    "lss bitrate without --store": "`bus.lss.bit_rate()` without store=True",
    "lss assign without --store": "`bus.lss.assign()` without store=True",
    "a profile's `filler` helps": "a profile's filler helps",
    "exit, then dvtcli bitrate": "close the bus, then `dvtcli bitrate`",
    "this session": "this program",
}  # fmt: skip
#: commands whose call has another name, or chooses another call by a word or an option
CALLS = {
    "pdo": "node.pdos",
    "node": "node.identity",
    "diff": "bus.plan",
    "eds add": "dvtcli.add_eds",
    "eds check": "dvtcli.check_eds",
    "eds convert": "dvtcli.convert",
    "eds list": "dvtcli.eds_library",
    "faults --clear": "node.clear_faults",
    "import": "bus.import_network",
    "lss assign": "bus.lss.assign",
    "lss bitrate": "bus.lss.bit_rate",
    "lss identify": "bus.lss.identify",
    "lss node-id": "bus.lss.node_id",
    "lss scan": "bus.lss.scan",
    "lss select": "bus.lss.select",
    "lss store": "bus.lss.store",
    "profiles": "dvtcli.profiles",
    "profiles show": "dvtcli.profile",
    "recover --finish": "bus.finish_stores",
    "save": "bus.script",
    "sync --check": "bus.check_sync",
}
#: commands whose call is the owner's method of that name
_OF_A_NODE = (
    "backup|clear|clone|compare|disable|download|enable|export|faults|learn|login|map|nmt|objects|read|recover|require"
    "|restore|set|store|undo|verify|vpdo|write"
)
_OF_A_BUS = "apply|check|link|load|plan|replay|report|scan|send|sync|unlink"
_ONLY_COMMANDS = "bitrate|decode|doctor|eds|explain|gateway|log|lss|monitor|plot|run|sim|trace|tour|watch"
_FLAGS = "yes|force|extended|frame|prove|all"
#: further options of a call that are true or false
_FLAGS_OF_A_CALL = f"{_FLAGS}|trust-stamp|twice"
#: simulated nodes, by their family
_SIMULATED = re.compile(r"(?:(?<=\bor )|(?<=: ))--sim ([a-z]\w*)")
_OPTION = re.compile(r"(?<![\w-])--([a-z]+(?:-[a-z]+)*)(?: (auto|keep|all)\b| (?=[A-Z]|\d|my-|\w[\w-]*[=@(,:]))?")
_LETTER = re.compile(rf"(?<![\w-])-([{''.join(_LETTERS)}])(?:/--[a-z]+)?(?![\w-])( (?=[A-Z\d]))?")
#: a command with options that stands in a sentence without marks
_BARE = re.compile(rf"\b({_OF_A_NODE}) --(mappable|{_FLAGS})\b(?: (tpdo|rpdo))?|^link \S+:\S+ \S+:\S+$")
#: what a text begins with that is about an option's value
_OF_OPTION = re.compile(r"^--([a-z]+)(?= [^:]+: )")

_EVERY_NAME = "|".join(sorted({_OF_A_NODE, _OF_A_BUS, _ONLY_COMMANDS, *(one.split()[0] for one in CALLS)}))
#: what follows a command in a hint that is not its argument: what it does
_DOES = (
    "asks|says|brings|chooses|finds|finishes|gives|goes|has|keeps|lets|lists|listens|makes|names|puts|sends|sets|shows|searches"
    "|does|starts|takes|tells|writes|(?:both )?compares|alone|as it is"
)
_SECOND = "scan|select|store|identify|node-id|add|show|list|convert|edit|preop|reset-node|reset-comm"
_TYPED = (
    rf"(?: (?:{_SECOND})\b)?"
    r"(?: --?[a-z][a-z-]*(?: [\w,-]*[\d_][\w,-]*| [a-z]+(?:,[a-z]+)+)?| [A-Z]+\b(?:\.[a-z]+)?…?"
    r"| (?:\d+:)?[tr]pdo\d+| [\d:]+[\w:]*| [\w-]+\.(?:csv|yaml|dbc|dcf)| …| all(?=,| ends))*"
)
#: a command that begins a clause of a hint: with what is typed behind it, before what it does or the clause's end
_COMMAND = re.compile(
    rf"(?:^|(?<=[;:,?] )|(?<=\bor )|(?<=\bthen )|(?<=\band ))(?:-n [A-Z\d]+ )?(?:{_EVERY_NAME}){_TYPED}"
    rf"(?= (?:{_DOES}|ends|first|again|everything|for|with|to)\b|[;:,.)]|$)"
)
#: English that begins as a command does
_ENGLISH = re.compile(
    r"(?:store|export|compare|read|clone|run|log|set|watch|map|replay)(?= (?:for|with|to|first)\b)|eds takes the path"
)


def hint_in_python(text: str) -> str:
    """A hint's *text* as a program wants it: `lss scan shows` is `bus.lss.scan()` shows, with or without marks."""
    for said, meant in _SENTENCES.items():
        text = text.replace(said, meant)
    parts = re.split(r"(`[^`]+`)", text)
    return _in_python("".join(part if part[:1] == "`" else _COMMAND.sub(_marked, part) for part in parts))


def _marked(found: re.Match[str]) -> str:
    return found[0] if _ENGLISH.match(found.string, found.start()) else f"`{found[0]}`"


def in_python(text: str) -> str:
    """A *text* as a program wants it: `--yes` is `yes=True`, `--eds FILE` is `eds=FILE`, `pdo` is `node.pdos()`."""
    for said, meant in _SENTENCES.items():
        text = text.replace(said, meant)
    return _in_python(text)


def _in_python(text: str) -> str:
    text = _SIMULATED.sub(r"dvtcli.simulate('\1')", text)
    text = _BARE.sub(lambda found: f"`{found[0]}`", text) if "`" not in text else text
    text = _OF_OPTION.sub(lambda found: f"{_ARGUMENTS.get(found[1], found[1])}:", text)
    parts = re.split(r"(`[^`]+`)", text)
    return "".join(f"`{_call(part[1:-1])}`" if part[:1] == "`" else _options(part) for part in parts)


def _options(text: str) -> str:
    """*text* whose options are arguments."""
    return _OPTION.sub(_argument, _LETTER.sub(_letter, text))


def _letter(option: re.Match[str]) -> str:
    return _LETTERS[option[1]] + ("=" if option[2] else "")


def _argument(option: re.Match[str]) -> str:
    """An option outside of a command."""
    name = _ARGUMENTS.get(option[1], option[1].replace("-", "_"))
    if option[2]:
        return f"{name}='{option[2]}'"
    if re.fullmatch(_FLAGS, option[1]):
        return f"{name}=True"
    return f"{name}=" if option[0].endswith(" ") else name


def _call(command: str) -> str:
    """The call for a *command*; for one that is a command only, how it is typed."""
    if re.match(r"dvtcli\b|node\.|bus\.", command):
        return command
    words = command.split()
    owner = "node"
    if words[0] == "-n" and len(words) > 2 and "," in words[1]:
        return f"dvtcli {command}"
    if words[0] == "-n" and len(words) > 2:
        owner, words = f"bus.node({words[1]})", words[2:]
    used = next((count for count in (2, 1) if " ".join(words[:count]) in CALLS), 1)
    if words[0] == "disable" and len(words) > 1 and (found := re.fullmatch(r"(\d+):(.+)", words[1])):
        owner, words[1] = f"bus.node({found[1]})", found[2]
    call = _named(" ".join(words[:used]), owner)
    if call is None:
        return f"dvtcli {command}" if re.fullmatch(_ONLY_COMMANDS, words[0]) else command
    arguments = _arguments(words[used:])
    if arguments is None:
        return f"dvtcli {command}"
    if words[0] in ("pdo", "node") and arguments:
        call = {"pdo": "node.pdo", "node": "bus.node"}[words[0]]
        arguments = [one for one in arguments if one != "everything=True"]
        call = call if arguments else "node.pdos"
    if words[0] == "nmt":
        arguments = arguments[:1]
    return f"{call}({', '.join(arguments)})"


def _named(command: str, owner: str) -> str | None:
    """What is called for a *command* without arguments; None where nothing is."""
    if command in CALLS:
        return CALLS[command]
    if re.fullmatch(_OF_A_BUS, command):
        return f"bus.{command}"
    return f"{owner}.{command}" if re.fullmatch(_OF_A_NODE, command) else None


def _arguments(words: list[str]) -> list[str] | None:
    """What stands behind a command, as arguments; None where a call has no such option."""
    found: list[str] = []
    rest = iter(words)
    for word in rest:
        option = word.removeprefix("--")
        if option == word:
            found.append(word if word.isupper() or (word.isdecimal() and len(word) < 4) or word == "…" else repr(word))
        elif re.fullmatch(_FLAGS_OF_A_CALL, option):
            found.append(f"{_ARGUMENTS.get(option, option).replace('-', '_')}=True")
        elif option == "mappable":
            found.append(f"mappable={next(rest, '')!r}")
        else:
            return None
    return found
