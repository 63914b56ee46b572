"""What every reader must do whatever bytes it is given: answer, or raise an error of ours. Anything else is a finding.

Each target is a function of bytes that returns in silence, or raises what was found.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
import sys
import unicodedata
import zlib
from collections.abc import Callable, Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NoReturn

import click

from dvtcli.cli.boundary import LEAVE, exit_code_of
from dvtcli.cli.conversation import Conversation
from dvtcli.cli.global_options import taken
from dvtcli.cli.lexer import split
from dvtcli.cli.main import install
from dvtcli.cli.object_params import ENTRY, OBJECT, DataTypeParam
from dvtcli.cli.params import NODE_ID, CanopenType, MillisecondsType
from dvtcli.cli.parse_line import parse
from dvtcli.cli.pdo_params import COB_ID, PDO
from dvtcli.cli.prompt.full_line import KeptHistory
from dvtcli.cli.registry import REGISTRY
from dvtcli.cli.run_line import run_words
from dvtcli.cli.scripts.script_parse import script_lines
from dvtcli.cli.view.output import Output
from dvtcli.device.change.journal import JournalFolder, read_journal
from dvtcli.device.described_node import FileValues
from dvtcli.device.node import Node
from dvtcli.device.read_pdos import present_pdos, read_pdo
from dvtcli.domain.datatypes import BY_SHORT_NAME, parse_number
from dvtcli.domain.gateway_requests import format_request, parse_request, sequence_of
from dvtcli.domain.gateway_words import GatewayRequestError
from dvtcli.domain.network.concise_dcf import concise_bytes, concise_entries
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.object_syntax import parse_cob_id, parse_object, resolve_entry, resolve_object
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Plan, Step, ValueChange
from dvtcli.domain.ports import Frame
from dvtcli.domain.profile import GENERIC, Severity
from dvtcli.domain.rules import Finding
from dvtcli.domain.scaling import Scaling
from dvtcli.domain.store import POWER, Proof
from dvtcli.errors import DvtcliError, InputFileError, RuleError, UsageError
from dvtcli.files.dbc import read_dbc
from dvtcli.files.device_file import parse_device_file
from dvtcli.files.eds.reader import EdsFile, parse_eds
from dvtcli.files.network.read_network import read_network
from dvtcli.files.network.write_network import write_network
from dvtcli.files.nodelist import read_nodelist
from dvtcli.files.pdo_yaml import read_pdo_yaml
from dvtcli.files.plan_file import is_network_plan, read_network_plan
from dvtcli.files.profiles import read_profile
from dvtcli.files.recordings.formats import formats
from dvtcli.files.recordings.recording_file import read_recorded
from dvtcli.files.sim_state import read_state
from dvtcli.files.values.value_file import read_values
from dvtcli.files.whole_device_file import read_whole_device
from dvtcli.operations import results
from dvtcli.operations.devices import eds_files
from dvtcli.operations.objects.search_objects import object_row
from dvtcli.operations.session.device_files import DeviceFiles
from dvtcli.operations.session.open_network import Network
from dvtcli.operations.user.options import node_id
from dvtcli.operations.user.settings import File, SettingsFile
from dvtcli.simulator.device.family import Family
from dvtcli.simulator.device.memory import Refusal
from dvtcli.simulator.device.sdo_server import SdoServer
from dvtcli.simulator.device.simulated_faults import Fault
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds
from dvtcli.simulator.network.station import SimulatedNode
from tests.fuzz.server import sdo_client
from tests.laws.bench import NODE, booted, dictionary, plain, profile
from tests.virtual_time import VirtualTimeBus

install()
Target = Callable[[bytes], None]

_FAMILIES = ("generic", "gen4", "tmcm", "roboteq")
#: exit codes that the documentation names, and what `exit` answers
_CODES = frozenset({LEAVE, 0, 1, 2, 3, 4, 5, 6, 7})
#: commands that write nothing to a device; all others get --dry-run
_READ_ONLY = frozenset({"pdo", "objects", "read", "require", "eds", "help", "node"})
#: commands that one thread and virtual time cannot run
_NOT_HERE = frozenset({"scan"})
#: thousands of SYNCs take the time that was asked for
_LONG_WORK = re.compile(r"--count\W+\w{4,}")
_COLOUR = re.compile(r"\x1b\[(?:0|1|2|3[1-6])m")


def _text(data: bytes) -> str:
    """Any text, lone surrogates too (as argv has them for bytes that are no UTF-8)."""
    return data.decode("utf-8", "surrogateescape")


def _one_line_of_ours(wrong: DvtcliError) -> None:
    """An error must be one that can be shown."""
    output = Output(io.StringIO(), io.StringIO())
    output.error(wrong)
    _harmless(output, coloured=False)


def eds(data: bytes) -> None:
    """A dictionary with everything in it, and findings; or InputFileError."""
    file = _parsed(data)
    if file is None:
        return
    assert file.understood <= file.sections
    assert all(finding.line >= 1 for finding in file.findings)
    described = file.dictionary
    for entry in described.entries():
        entry.initial(127)
        entry.limits(1)
        described.place(entry)
        object_row(described, entry, 1)
        assert described.display_name(entry.index, entry.sub_index)
    described.find("Device type")
    file.values("DeviceInfo")
    eds_files.facts("fuzz.eds", file)
    eds_files.report("fuzz.eds", file, eds_files.chosen_rules())


def dcf(data: bytes) -> None:
    """The PDOs that a file sets, and a simulated device made of it: values, or errors of ours."""
    file = _parsed(data)
    if file is None:
        return
    _read_pdos(file.dictionary)
    device = StrictDevice(file.dictionary, Family(), NODE)
    device.boot_up()
    for entry in file.dictionary.entries():
        with contextlib.suppress(Refusal):
            device.upload(entry.index, entry.sub_index)
    device.state = NmtState.OPERATIONAL
    device.services.sync()
    device.services.poll(1.0)
    device.services.receive(Frame(0x200 + NODE, bytes(8)))
    device.services.emergency(0x8210)


def _parsed(data: bytes) -> EdsFile | None:
    try:
        return parse_eds(data, "fuzz.eds")
    except InputFileError as wrong:
        _one_line_of_ours(wrong)
        return None


def _read_pdos(described: ObjectDictionary) -> None:
    values = FileValues(described, NODE)
    for pdo in present_pdos(values, described)[:16]:
        with contextlib.suppress(DvtcliError):
            read_pdo(values, pdo)


def profile_toml(data: bytes) -> None:
    """A profile, or InputFileError."""
    try:
        read_profile(data.decode("utf-8", "replace"), "fuzz.toml")
    except InputFileError as wrong:
        _one_line_of_ours(wrong)


def defaults(data: bytes) -> None:
    """Options for the start, or InputFileError."""
    Path("dvtcli.toml").write_bytes(data)
    try:
        given = File(SettingsFile("dvtcli.toml"), users_own=False).layer
        session = _session()
        session.start({name: value for name, (value, _) in given.items()})
        with REGISTRY.make_context("dvtcli", ["pdo"], obj=session) as ctx:
            session.start(taken(ctx.params))
    except (InputFileError, UsageError) as wrong:
        _one_line_of_ours(wrong)
    except click.UsageError as wrong:
        wrong.format_message()
    finally:
        Path("dvtcli.toml").unlink()


def script(data: bytes) -> None:
    """Every line parsed by its command, with names and without; or the line's error."""
    try:
        lines = script_lines(data, "fuzz.dvt")
    except (UsageError, InputFileError) as wrong:
        _one_line_of_ours(wrong)
        return
    session = _session()
    session.start({"sim": ("gen4",)} if zlib.crc32(data) & 1 else {})
    session.started = True
    for line in lines:
        _parse_line(line.words, session)


def _parse_line(words: list[str], session: Conversation) -> None:
    try:
        with contextlib.redirect_stdout(io.StringIO()), parse(words, session):
            pass
    except click.UsageError as wrong:
        wrong.format_message()
    except click.exceptions.Exit:
        pass  # --help
    except DvtcliError as wrong:
        _one_line_of_ours(wrong)


def line(data: bytes) -> None:
    """A line ends with one of the documented exit codes, and --dry-run sends nothing but reads."""
    text = _text(data)
    try:
        words = split(text)
    except UsageError:
        return
    if not words or words[0] in _NOT_HERE or _LONG_WORK.search(text):
        return
    family = _FAMILIES[zlib.crc32(data) % len(_FAMILIES)]
    session = _session()
    bus = VirtualTimeBus([_fresh(family)], timeout_s=0.1)
    dry_run = words[0] not in _READ_ONLY
    session.start({"node": NODE, "profile": family, "eds": str(family_eds(family)), "dry_run": dry_run})
    session._network = Network(bus, DeviceFiles(bus, session.options), session.cancellation, session.consent)
    session.started = True
    sent: list[Frame] = []
    bus.tap(lambda frame, ours: sent.append(frame) if ours else None)
    with _standard_streams():
        code = run_words(words, session)
        settled = exit_code_of(session, lambda: session.end_line(code))
    assert code in _CODES, f"exit code {code}: {_told(session)}"
    assert settled == 0
    _harmless(session.output, coloured=session.base.color == "always")
    if session.base.dry_run:
        assert all(_reads(frame) for frame in sent), [str(frame) for frame in sent if not _reads(frame)]


def device(data: bytes) -> None:
    """Lines on a simulated node that a damaged file describes: a documented exit code, and nothing but reads sent."""
    file = _parsed(data)
    if file is None:
        return
    simulated = StrictDevice(file.dictionary, Family(), NODE)
    session = _session()
    bus = VirtualTimeBus([simulated], timeout_s=0.1)
    session.start({"node": NODE, "profile": "generic", "dry_run": True})
    session._network = Network(bus, DeviceFiles(bus, session.options), session.cancellation, session.consent)
    session._network.nodes[NODE] = Node(bus, NODE, file.dictionary, GENERIC, session.cancellation, session.consent)
    session.started = True
    sent: list[Frame] = []
    bus.tap(lambda frame, ours: sent.append(frame) if ours else None)
    for words in _LINES:
        code = run_words(words, session)
        assert code in _CODES, f"{words}: exit code {code}: {_told(session)}"
    exit_code_of(session, lambda: session.end_line(0))
    _harmless(session.output, coloured=False)
    assert all(_reads(frame) for frame in sent), [str(frame) for frame in sent if not _reads(frame)]


_LINES = [
    line.split()
    for line in (
        *("pdo --all", "objects", "objects --mappable tpdo", "read 1018:1", "read 2000", "pdo tpdo1 --json"),
        *("map tpdo1 2000 1000/8", "set tpdo1 --type 1 --json", "clear rpdo1", "write 2000 1", "store", "undo --all"),
    )
]


def _reads(frame: Frame) -> bool:
    """Whether a frame is an SDO upload of ours or gives one up."""
    return frame.can_id & 0x780 == 0x600 and frame.data[0] >> 5 in (2, 3, 4)


@contextlib.contextmanager
def _standard_streams() -> Iterator[None]:
    """An empty stdin, and a stdout for what click itself prints."""
    stdin, sys.stdin = sys.stdin, io.TextIOWrapper(io.BytesIO())
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            yield
    finally:
        sys.stdin = stdin


def syntax(data: bytes) -> None:
    """Objects, entries, COB-IDs, PDOs, numbers, times, types and values: a value, or ValueError that says why."""
    text = _text(data)
    described, aliases = dictionary("gen4"), profile("gen4").aliases
    readers: tuple[Callable[[str], object], ...] = (
        parse_object,
        parse_cob_id,
        parse_number,
        Pdo.parse,
        lambda word: resolve_object(word, described, aliases),
        lambda word: resolve_entry(word, described, aliases),
        lambda word: resolve_entry(word, None),
    )
    for reader in readers:
        with contextlib.suppress(ValueError):
            reader(text)
    for kind in BY_SHORT_NAME.values():
        with contextlib.suppress(ValueError):
            kind.decode(kind.parse(text))
    types: tuple[CanopenType, ...] = (
        *(PDO, OBJECT, ENTRY, COB_ID, NODE_ID),
        *(DataTypeParam(), MillisecondsType(100), MillisecondsType(1000)),
    )
    for kind_of_word in types:
        with contextlib.suppress(click.UsageError):
            kind_of_word.convert(text, None, None)
    with contextlib.suppress(UsageError):
        node_id(text)


def journal(data: bytes) -> None:
    """A journal that is the same when written and read again, or InputFileError."""
    path = Path("fuzz-1.json")
    path.write_bytes(data)
    try:
        found = read_journal(path)
    except InputFileError as wrong:
        _one_line_of_ours(wrong)
        return
    assert 1 <= found.plan.node_id <= 127
    for step in found.plan.steps:
        assert 0 <= step.index <= 0xFFFF
        assert 0 <= step.sub_index <= 0xFF
    with contextlib.suppress(ValueError):  # the value before is not known
        found.plan.reversed()
    journals = JournalFolder(Path("journals"), "fuzz")
    again = read_journal(journals.write(found.plan, found.identity, found.nmt_state))
    assert (again.plan, again.identity, again.nmt_state) == (found.plan, found.identity, found.nmt_state)


def fault(data: bytes) -> None:
    """A fault that is the same when written and read again, or ValueError."""
    try:
        found = Fault.parse(_text(data))
    except ValueError:
        return
    assert Fault.parse(str(found)) == found


def sdo_server(data: bytes) -> None:
    """Every request is answered with frames of 8 bytes, or with silence; every frame is survived."""
    device = _fresh(_FAMILIES[len(data) % len(_FAMILIES)])
    server = SdoServer(device)
    node = SimulatedNode(device)
    at = 0
    while at < len(data):
        length, rest = data[at] & 0x0F, data[at] >> 4
        request = data[at + 1 : at + 1 + length]
        at += 1 + length
        answer = server.handle(request)
        if answer is not None:
            assert len(request) == 8
            assert request[0] != 0x80
            answers = [answer, *server.take_more()]
            assert all(len(one) == 8 for one in answers)
            assert len(answers) <= 127  # a sub-block
        base = (0x000, 0x080, 0x200, 0x300, 0x600, 0x600, 0x700)[rest % 7]
        for sent in node.handle(Frame(base + (NODE if base else 0), request[:8]), at / 1000):
            assert len(sent.data) <= 8
            assert sent.can_id <= 0x1FFF_FFFF
        node.poll(at / 1000)


def view(data: bytes) -> None:
    """No control or format character of a device or a file reaches a terminal, and documents are strict JSON."""
    text = _text(data)
    for shown in _shown(text):
        for colour, ascii_only, style in (("always", False, "text"), ("never", True, "text"), ("never", False, "json")):
            output = Output(io.StringIO(), io.StringIO())
            output.configure(style, colour, 2, quiet=False, plain=ascii_only)
            if isinstance(shown, DvtcliError):
                output.error(shown, f"{text}:1")
            else:
                output.result(shown)
            _harmless(output, coloured=colour == "always")
    output = Output(io.StringIO(), io.StringIO())
    output.verbose = 1 + len(data) % 2
    output.note(text)
    output.warning(text)
    with _standard_streams():
        assert not output.ask(text)
    output.traffic(Frame(0x581 if data[:1] < b"\x80" else 0x601, data[:8]), sent=False)
    _harmless(output, coloured=False)


def _shown(text: str) -> Iterator[Any]:
    """An error and a result of each kind with *text* wherever text from a file or a device may stand."""
    error = DvtcliError(text, node=1, place=text, abort=0x0601_0002, why=text, hint=text, state="left_changed")
    error.details.append(("step", text))
    yield error
    finding = Finding(text, Severity.ERROR, text, text, 0x0604_0041, text)
    yield RuleError(text, [finding, finding], node=1)
    described = dictionary("gen4")
    pdo, config = Pdo.parse("tpdo1"), read_pdo(FileValues(described, 1), Pdo.parse("tpdo1"))
    names = tuple(results.MappedName(text, text, Scaling(text)) for _ in config.mapping)
    row = results.PdoRow(pdo, config, names)
    yield results.PdoListing(1, text, (row,), show_all=True)
    yield results.PdoListing(1, text, (row,), detail=True)
    raw = text.encode("utf-8", "surrogateescape")
    yield results.ValueRead(1, "1008:00", text, text, raw, text, Scaling(text))
    yield results.ValueRead(1, "2000:00", text, float("nan"), raw[:4], text, Scaling(text))
    plan = Plan(1, (ValueChange(Step(0x2000, 1, raw, raw, text)),))
    yield results.Changed(1, plan, (finding,), dry_run=False, seconds=0.1)
    for word, found in (("store", (text,)), ("store", ()), ("restore", (text,)), ("restore", ())):
        proof = Proof(POWER, 1, text, found, text, text, (text,))
        stored = results.Stored(1, text, word, 0.1, 1.0, (text,), dry_run=False, proof=proof, because=text)
        yield stored
        if stored.failure is not None:
            yield stored.failure
    yield results.Stored(1, text, "store", 0.1, 1.0, (), dry_run=False, skipped=text)
    yield results.Compared(1, 1, 1, ((text, text),), text, ((text, None, 1.0),), text)
    yield results.ObjectListing(1, text, (results.ObjectRow(text, text, text, text, text, text),), 1)
    node = results.NodeRow(1, text, 1, 1, 1, 1, 1, text, text)
    yield results.NodeListing(text, (node, node), 0.1)
    yield results.Facts(text, ((text, text),), (text,))
    wrong = results.FileFinding(1, "warning", "bad-line", text, text)
    rule = results.FileRule("bad-line", "warning", text, text)
    yield results.FileReport(text, 1, 1, 1, (rule,), (wrong,), strict=True)


def _harmless(output: Output, *, coloured: bool) -> None:
    """Nothing but newlines and our own colours may steer the terminal; JSON is one strict document a line."""
    for stream in (output.stdout, output.stderr):
        assert isinstance(stream, io.StringIO)
        written = stream.getvalue()
        if coloured:
            written = _COLOUR.sub("", written)
        if written.isascii() and written.replace("\n", "").isprintable():
            pass
        else:
            bad = {char for char in written if char != "\n" and unicodedata.category(char) in ("Cc", "Cf", "Cs")}
            assert not bad, f"{sorted(map(ascii, bad))} reached the terminal"
        if output.plain:
            assert written.isascii()
        if output.json and stream is output.stdout:
            for document in written.splitlines():
                json.loads(document, parse_constant=_no_json)


def _no_json(word: str) -> NoReturn:
    raise AssertionError(f"{word} is no JSON")


def _told(session: Conversation) -> str:
    assert isinstance(session.output.stderr, io.StringIO)
    return session.output.stderr.getvalue()


def _session() -> Conversation:
    return Conversation(Output(io.StringIO(), io.StringIO()))


@cache
def _model(family: str) -> StrictDevice:
    return booted(family)


def _fresh(family: str) -> StrictDevice:
    device = StrictDevice(_model(family).dictionary, plain(family), NODE)
    device.boot_up()
    device.take_outbox()
    return device


def network(data: bytes) -> None:
    """A network that can be written, or InputFileError."""
    try:
        config = read_network(data.decode("utf-8", "replace"), "fuzz.yaml")
    except InputFileError as wrong:
        _one_line_of_ours(wrong)
        return
    write_network(config)


def dbc(data: bytes) -> None:
    """Layouts that read any frame, or InputFileError."""
    Path("fuzz.dbc").write_bytes(data)
    try:
        layouts = read_dbc("fuzz.dbc")
    except InputFileError as wrong:
        _one_line_of_ours(wrong)
        return
    for layout in layouts.values():
        for length in (0, 3, layout.byte_length or 0, 64):
            assert len(layout.read(bytes(range(length % 256)))) == len(layout.signals)


def recording(data: bytes) -> None:
    """Frames, or InputFileError: the first byte says of which format."""
    suffixes = [suffix for suffix in formats() if suffix != ".mf4"]
    path = Path(f"fuzz{suffixes[data[0] % len(suffixes)] if data else '.log'}")
    path.write_bytes(data[1:])
    try:
        for one in read_recorded(path):
            assert len(one.frame.data) <= 64
            Output(io.StringIO(), io.StringIO()).traffic(one.frame, sent=False)
    except InputFileError as wrong:
        _one_line_of_ours(wrong)


def mdf(data: bytes) -> None:
    """Frames, or InputFileError, by a process of asammdf's that ends by itself."""
    path = Path("fuzz.mf4")
    path.write_bytes(data)
    try:
        assert all(len(one.frame.data) <= 64 for one in read_recorded(path))
    except InputFileError as wrong:
        _one_line_of_ours(wrong)


def values(data: bytes) -> None:
    """Values by time, or InputFileError: the first byte says of which form."""
    path = Path("fuzz.csv" if not data or data[0] & 1 else "fuzz.jsonl")
    path.write_bytes(data[1:])
    try:
        read = read_values(path)
        assert all(len(row) <= len(read.columns) for _, row in read.rows)
    except InputFileError as wrong:
        _one_line_of_ours(wrong)


def xdd(data: bytes) -> None:
    """A dictionary with everything in it, and findings; or InputFileError."""
    try:
        file = parse_device_file(data, "fuzz.xdd")
    except InputFileError as wrong:
        _one_line_of_ours(wrong)
        return
    _read_pdos(file.dictionary)
    for entry in file.dictionary.entries():
        entry.initial(127)
        entry.limits(1)
        object_row(file.dictionary, entry, 1)


def gateway_line(data: bytes) -> None:
    """A request that is the same when written and read again, or what is wrong with its line."""
    text = data.decode("latin-1").partition("\n")[0]
    sequence_of(text)
    try:
        request = parse_request(text)
    except GatewayRequestError:
        return
    if request is not None:
        assert parse_request(format_request(request)) == request


def concise(data: bytes) -> None:
    """Entries that are the same when written and read again, or ValueError."""
    with contextlib.suppress(ValueError):
        entries = concise_entries(data)
        assert concise_entries(concise_bytes(entries)) == entries


def history(data: bytes) -> None:
    """Lines that were typed, whatever is in the file."""
    path = Path("fuzz.history")
    path.write_bytes(data)
    assert all(isinstance(text, str) for text in KeptHistory(str(path), lambda _text: False).load_history_strings())


def kept(data: bytes) -> None:
    """What dvtcli keeps or is handed besides, or InputFileError: the first byte says what."""
    kind, rest = (data[0] % 5 if data else 0), data[1:]
    path = Path("fuzz.json")
    path.write_bytes(rest)
    text = rest.decode("utf-8", "replace")
    readers: tuple[Callable[[], object], ...] = (
        lambda: read_nodelist(rest, "fuzz.cpj"), lambda: read_pdo_yaml(text, Pdo.parse("tpdo1")),
        lambda: read_state(path), lambda: read_whole_device(path),
        lambda: is_network_plan(path) and read_network_plan(path),
    )  # fmt: skip
    try:
        readers[kind]()
    except InputFileError as wrong:
        _one_line_of_ours(wrong)


#: every target by the name that options and messages use
TARGETS: dict[str, Target] = {
    target.__name__: target
    for target in (
        *(eds, dcf, profile_toml, defaults, script, line, syntax, journal, fault),
        *(sdo_client, sdo_server, view, device),
        *(network, dbc, recording, values, xdd, gateway_line, concise, history, kept),
        *([mdf] if find_spec("asammdf") else []),
    )
}
