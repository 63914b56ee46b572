"""`log`, `decode` and `plot` as a user's shell starts them."""

from __future__ import annotations

import csv
import io
import signal
import subprocess
import sys
from datetime import datetime
from pathlib import Path

import can
import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.dbc import read_dbc
from dvtcli.files.extras import extra
from dvtcli.files.recordings.recording_file import Recorder
from dvtcli.files.values.value_file import read_values
from dvtcli.simulator.network.family_file import family_eds
from tests.cli.commands.bench import Bench
from tests.files.recordings import APPENDABLE, BEGIN_S, FORMATS, ROTATING
from tests.process import PATIENCE_S, documents, dvtcli, environment, run
from tests.simulator.serve.served import bus_words, own_environment, served, wait_for
from tests.small_recording import ramp, velocity

pytestmark = pytest.mark.drawn(8, "recording commands")

GEN4 = str(family_eds("gen4"))
DBC = """VERSION ""
BS_:
BU_: Drive
BO_ 641 Motion: 8 Drive
 SG_ Speed : 0|32@1- (0.5,0) [0|0] "rpm" Vector__XXX
 SG_ Torque : 32|16@1- (0.1,0) [0|0] "%" Vector__XXX
"""


@pytest.mark.parametrize("name", ["log", "decode"])
def test_help_names_every_format(name: str) -> None:
    """A format is told by the help of both, and by the options of `log` that it allows."""
    told, place = " ".join(dvtcli("help", name).stdout.split()), f"dvtcli/cli/commands/{name}.py, in the help"
    silent = [suffix for suffix in FORMATS if suffix not in told]
    assert not silent, f"name {' '.join(silent)} in {place}"
    if name == "log":
        for said in (f"Append to FILE ({' '.join(APPENDABLE)})", f"this many bytes ({' '.join(ROTATING)})"):
            assert said in told, f"say “{said}” in {place} of its option"


@pytest.mark.parametrize("suffix", sorted(set(FORMATS) - {".mf4"}))
def test_what_is_logged_is_decoded(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"run{suffix}"
    done = dvtcli("--sim", "gen4", "--json", stdin=f"nmt start\nlog {path} --duration 1\n")
    assert done.returncode == 0, done.stderr
    logged = documents(done.stdout)[-1]
    assert logged["schema"] == "dvtcli.log/1"
    assert logged["frames"] >= 5
    assert logged["dropped"] == 0
    assert logged["bytes"] == path.stat().st_size
    found = documents(dvtcli("--sim", "gen4", "decode", str(path), "--json").stdout)
    assert len(found) == logged["frames"]
    tpdo2 = [one for one in found if one["pdo"] == "tpdo2"]
    assert tpdo2
    assert all(one["signals"]["Velocity actual value"] == -1500 for one in tpdo2)


@pytest.mark.needs("asammdf")
def test_mf4_is_decoded(tmp_path: Path) -> None:
    path = tmp_path / "run.mf4"
    done = dvtcli("--sim", "gen4", "--json", stdin=f"nmt start\nlog {path} --duration 1\n")
    assert done.returncode == 0, done.stderr
    found = documents(dvtcli("--sim", "gen4", "decode", str(path), "--json").stdout)
    assert len(found) == documents(done.stdout)[-1]["frames"]


@pytest.mark.needs("asammdf")
def test_asammdf_which_takes_a_second_is_imported_for_mf4_alone(tmp_path: Path) -> None:
    imports = environment() | {"PYTHONPROFILEIMPORTTIME": "1"}
    silent = ("-i", "virtual", "-c", "x", "-n", "1", "--timeout", "0.05", "read", "1018:1")
    ran = run(silent, env=imports)
    assert (ran.returncode, "can.io.mf4" in ran.stderr, "asammdf.blocks" in ran.stderr) == (5, True, False)
    ran = run(("--sim", "gen4", "log", str(tmp_path / "run.mf4"), "--duration", "1"), env=imports)
    assert (ran.returncode, "asammdf.blocks" in ran.stderr) == (0, True)
    ran = run(("decode", str(tmp_path / "run.mf4"), "--json"), env=imports)
    assert len(documents(ran.stdout)) >= 2, ran


@pytest.mark.parametrize("words", [["log", "run.log"], ["--no-reconnect", "monitor"]])
def test_a_server_that_goes_away_ends_the_watching(tmp_path: Path, words: list[str]) -> None:
    words = [str(tmp_path / word) if word == "run.log" else word for word in words]
    with served(tmp_path, "gen4@5") as server:
        process = subprocess.Popen(
            [sys.executable, "-m", "dvtcli", *bus_words(server.port), *words],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8", env=own_environment(tmp_path),
        )  # fmt: skip
        began = process.stderr if "log" in words else process.stdout  # "Ctrl-C ends it", or the first frame
        assert began is not None
        assert began.readline()
        server.end()
        _, complaints = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 5, complaints
    assert "closed the connection" in complaints
    assert "Traceback" not in complaints


def test_ctrl_c_ends_a_log_with_its_summary(tmp_path: Path) -> None:
    path = tmp_path / "run.log"
    with served(tmp_path, "gen4@5") as server:
        bus = server.attach()
        process = subprocess.Popen(
            [sys.executable, "-m", "dvtcli", *bus_words(server.port), "log", str(path), "--filter", "181:7FF"],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8", env=own_environment(tmp_path),
        )  # fmt: skip
        assert process.stderr is not None
        assert "Ctrl-C ends it" in process.stderr.readline()
        for n in range(100):
            bus.send(can.Message(arbitration_id=0x181, data=[n], is_extended_id=False))
            bus.send(can.Message(arbitration_id=0x182, data=[n], is_extended_id=False))
        wait_for(lambda: path.exists() and b"181#63" in path.read_bytes(), "the last frame in the file")
        process.send_signal(signal.SIGINT)
        said, complaints = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130, complaints
    assert "frames in" in said
    assert ", 0 dropped, " in said
    logged = [message.data[0] for message in can.CanutilsLogReader(str(path)) if message.data]
    assert logged[: len(logged)] == list(range(100 - len(logged), 100))
    assert logged
    assert "Traceback" not in complaints


def test_values_become_a_column_each(tmp_path: Path) -> None:
    path = tmp_path / "values.csv"
    done = dvtcli("--sim", "gen4", stdin=f"nmt start\nlog {path} --decode --duration 1\n")
    assert done.returncode == 0, done.stderr
    rows = list(csv.DictReader(io.StringIO(path.read_text("utf-8"))))
    assert rows
    tpdo2 = [row for row in rows if row["frame"] == "TPDO2 node 1"]
    assert {row["TPDO2 node 1 606C:00 Velocity actual value [rpm]"] for row in tpdo2} == {"-1500"}
    assert {row["TPDO2 node 1 5100:02 Device measurements.Battery current [A]"] for row in tpdo2} == {"-7.5"}
    assert {row["TPDO1 node 1 6041:00 Statusword"] for row in tpdo2} == {""}


def test_decode_as_csv_by_a_file(tmp_path: Path) -> None:
    path = ramp(tmp_path / "run.log")
    done = dvtcli("decode", str(path), "--csv", "--eds", GEN4)
    rows = list(csv.DictReader(io.StringIO(done.stdout)))
    column = "TPDO2 node 1 606C:00 Velocity actual value [rpm]"
    assert [int(row[column]) for row in rows] == [10 * n - 100 for n in range(50)]


def test_decode_by_a_dbc(tmp_path: Path) -> None:
    dbc = tmp_path / "drive.dbc"
    dbc.write_text(DBC, encoding="utf-8")
    found = documents(dvtcli("decode", str(ramp(tmp_path / "run.asc")), "--dbc", str(dbc), "--json").stdout)
    assert [one["signals"]["Speed"] for one in found] == [5.0 * n - 50 for n in range(50)]
    assert found[0]["kind"] == "message"


@pytest.mark.needs("cantools")
@pytest.mark.needs("pyarrow")
@pytest.mark.parametrize("layout", ["long", "wide"])
def test_messages_of_one_name_in_a_dbc_are_told_apart(tmp_path: Path, layout: str) -> None:
    (tmp_path / "two.dbc").write_text(DBC + DBC[DBC.index("BO_ ") :].replace("BO_ 641", "BO_ 642"))
    with Recorder(tmp_path / "run.log") as recorder:
        for can_id in (0x281, 0x282):
            recorder.write(velocity(can_id, 0.1)._replace(can_id=can_id))
    words = ["run.log", "-d", "two.dbc"]
    done = dvtcli("decode", *words, "-o", "a.parquet", "--layout", layout, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    read = read_values(tmp_path / "a.parquet")
    names = [column.name for column in read.columns]
    assert len({*names}) == len(names)
    assert {name.split()[1] for name in names} == {"0x281", "0x282"}
    assert len(list(read.rows)) == 2


def test_decode_by_a_network_file(tmp_path: Path) -> None:
    """What the file says of its node's values goes before what the family says of them."""
    network = tmp_path / "press.yaml"
    network.write_text(
        "nodes: {drive: {node_id: 1, profile: gen4, physical: {606C: 0.1 m/s}, tpdo: {2: {enabled: true}}}}\n", "utf-8"
    )
    done = dvtcli("decode", str(ramp(tmp_path / "run.log", 1)), "-d", str(network))
    assert "Velocity actual value=-10.0 m/s (-100)  Torque actual value=12.0 % (120)" in done.stdout
    network.write_text("nodes: {drive: {node_id: 1, profile: gen4, physical: {606C: {factor: 0}}}}\n", "utf-8")
    done = dvtcli("decode", str(tmp_path / "run.log"), "-d", str(network))
    assert done.returncode == 4
    assert "physical.606C.factor: a factor of 0 makes all values the same" in done.stderr


def test_without_a_mapping_frames_stay_bytes(tmp_path: Path) -> None:
    done = dvtcli("decode", str(ramp(tmp_path / "run.log", 2)))
    at, *rest = done.stdout.splitlines()[0].split()
    assert at == datetime.fromtimestamp(BEGIN_S).astimezone().timetz().isoformat(timespec="microseconds")
    assert rest == [
        "0x281", "TPDO2?", "node", "1", "9C", "FF", "FF", "FF", "78", "00", "88", "FF",
    ]  # fmt: skip


def test_plot_draws_on_the_terminal(tmp_path: Path) -> None:
    path = str(ramp(tmp_path / "run.log"))
    done = dvtcli("plot", path, "606C", "torque actual value", "--eds", GEN4, "--ascii")
    assert done.returncode == 0, done.stderr
    assert "Velocity actual value  606C:00  -100 .. 390 rpm, 50 samples in 4.90 s" in done.stdout
    assert done.stdout.isascii()
    graph = done.stdout.split("Torque")[0].splitlines()[1:-2]
    heights = [
        min((row for row, line in enumerate(graph) if line[12:][x : x + 1] == "*"), default=None) for x in (2, 60)
    ]
    assert heights[0] is not None
    assert heights[1] is not None
    assert heights[0] > heights[1], done.stdout


@pytest.mark.needs("matplotlib")
@pytest.mark.drawn(1)
@pytest.mark.parametrize(("suffix", "begin"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF")])
def test_plot_draws_a_picture(tmp_path: Path, suffix: str, begin: bytes) -> None:
    picture = tmp_path / f"speed{suffix}"
    words = ["plot", str(ramp(tmp_path / "run.log")), "606C", "--eds", GEN4, "-o", str(picture)]
    assert dvtcli(*words).returncode == 0
    assert picture.read_bytes().startswith(begin)
    assert dvtcli(*words).returncode == 6
    assert dvtcli(*words, "--yes").returncode == 0


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (["decode", "none.log"], 2, "No such file"),
        (["decode", "empty.log"], 4, "has no frames"),
        (["decode", "damaged.log"], 4, "damaged.log:2"),
        (["decode", "run.xyz"], 2, ".blf (Vector binary)"),
        (["decode", "run.log", "--dbc", "none.dbc"], 2, "No such file"),
        (["decode", "run.log", "--dbc", "run.log"], 4, "-d takes a DBC file or a network file"),
        (["decode", "run.log", "--dbc", "run.log"], 4, "is not a DBC file"),
        (["decode", "run.log", "--dbc", GEN4], 4, "--eds gen4.eds takes an EDS"),
        (["decode", "run.log", "--csv"], 2, "need a mapping"),
        (["plot", "run.log", "velocity", "--eds", GEN4], 2, "Velocity actual value"),
        (["plot", "run.log", "606C"], 2, "no signals"),
        (["plot", "run.log", "606C", "--eds", GEN4, "-o", "x.gif"], 2, ".png"),
        (["plot", "nowhere.log", "velocity_actual_value"], 2, "nowhere.log: No such file"),
        (["decode", "nowhere.log", "--csv"], 2, "nowhere.log: No such file"),
        (["log", "run.db", "--sim", "gen4"], 2, "loses frames"),
        (["log", "run.csv", "--sim", "gen4"], 2, "base64"),
        (["log", "new.asc", "-a", "--sim", "gen4"], 2, "appended"),
        (["log", "run.log", "--sim", "gen4"], 6, "overwrite"),
        (["log", "nowhere/run.log", "--sim", "gen4"], 2, "No such file"),
        (["log", "x.log", "--decode", "--sim", "gen4"], 2, ".csv"),
        (["log", "x.csv", "--decode", "--filter", "nothing", "--sim", "gen4"], 2, "no signal has 'nothing'"),
        (["decode", "run.log", "--csv", "--eds", GEN4, "--filter", "nothing"], 2, "no signal has 'nothing'"),
        (["decode", "run.log", "--eds", GEN4, "-o", "x.xlsx"], 2, ".parquet"),
        (["plot", "nowhere.csv", "speed"], 2, "nowhere.csv: No such file"),
        pytest.param(
            ["plot", "nowhere.parquet", "speed"], 2, "nowhere.parquet: no such file", marks=pytest.mark.needs("pyarrow")
        ),
        (["log", "x.log", "--filter", "zz", "--sim", "gen4"], 2, "ID:MASK"),
    ],
)
def test_what_goes_wrong_is_said(tmp_path: Path, words: list[str], code: int, says: str) -> None:
    ramp(tmp_path / "run.log")
    (tmp_path / "empty.log").write_bytes(b"")
    (tmp_path / "damaged.log").write_text("(1.0) can0 181#00\n(2.0) can0 181#QQ\n", encoding="utf-8")
    done = dvtcli(*words, cwd=tmp_path)
    assert done.returncode == code, done.stdout + done.stderr
    assert says in done.stderr


def test_names_in_files_steer_no_terminal(tmp_path: Path) -> None:
    eds = tmp_path / "hostile.eds"
    text = Path(GEN4).read_text("latin-1")
    assert "ParameterName=Velocity actual value" in text
    eds.write_bytes(text.replace("=Velocity actual value", "=Velo\x1b]0;pwned\x07city").encode("latin-1"))
    path = str(ramp(tmp_path / "run.log"))
    for words in (["decode", path], ["plot", path, "606C"]):
        done = dvtcli(*words, "--eds", str(eds))
        assert done.returncode == 0, done.stderr
        assert "\x1b" not in done.stdout
        assert "Velo\\x1b]0;pwned" in done.stdout


def test_an_extra_that_is_missing_is_named() -> None:
    with pytest.raises(UsageError, match="drawing a picture needs no_such_package") as caught:
        extra("no_such_package.figure", "plot", "drawing a picture")
    assert typed(caught.value.hint) == "pip install 'canopen-dvtcli[plot]'"


def test_without_cantools_only_a_dbc_file_misses_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in the plain install: what is no DBC file is said to be none, and for one that is there are other ways."""
    monkeypatch.setitem(sys.modules, "cantools", None)
    page, dbc = tmp_path / "rep.html", tmp_path / "all.dbc"
    page.write_text("<!DOCTYPE html>", "utf-8")
    dbc.write_text('VERSION ""\n\nBU_: A\n', "utf-8")
    with pytest.raises(InputFileError, match=r"^rep\.html is not a DBC file$"):
        read_dbc(str(page))
    with pytest.raises(UsageError, match=r"^reading all\.dbc, a DBC file, needs cantools$") as caught:
        read_dbc(str(dbc))
    assert caught.value.hint is not None
    assert typed(caught.value.hint).startswith("pip install 'canopen-dvtcli[dbc]'; a network file (-d net.yaml)")


def test_a_filter_that_nothing_has_in_its_name_is_an_error_in_each_form(tmp_path: Path) -> None:
    log, dbc = tmp_path / "run.log", tmp_path / "a.dbc"
    log.write_text("(1.0) can0 281#44FFFFFF780088FF\n(2.0) can0 701#05\n", "ascii")
    with Bench(("gen4@1",)) as bench:
        assert bench.run(f"export {dbc}").code == 0
    with Bench(()) as bench:
        for form in ("", " --json", " --csv", f" -o {tmp_path / 'x.csv'}"):
            ran = bench.run(f"decode {log} -d {dbc} --filter nosuch{form}")
            assert (ran.code, "'nosuch' in its name" in ran.stderr + ran.stdout) == (2, True), form
        for there in ("velocity", "heartbeat"):
            assert bench.run(f"decode {log} -d {dbc} --filter {there}").code == 0
        quiet = bench.run(f"decode {log} -d {dbc} --filter statusword")  # in a frame that was not recorded
        assert (quiet.code, "no frame in it carries" in quiet.stderr) == (0, True)


def test_an_eds_beside_a_dbc_is_said_not_to_be_used(tmp_path: Path) -> None:
    log, dbc = tmp_path / "run.log", tmp_path / "a.dbc"
    log.write_text("(1.0) can0 281#44FFFFFF780088FF\n", "ascii")
    with Bench(("gen4@1",)) as bench:
        assert bench.run(f"export {dbc}").code == 0
    with Bench((), {"eds": "generic"}) as bench:
        ran = bench.run(f"decode {log} -d {dbc}")
        assert (ran.code, f"--eds generic is not used: {dbc} describes" in ran.stderr) == (0, True)


def test_an_error_in_standard_input_names_it() -> None:
    done = dvtcli("decode", "-", stdin=" can0  285   [8]  24 FA FF FF 78 00 88 FF\nrubbish\n")
    assert (done.returncode, "error: stdin:2: damaged" in done.stderr, "dvtcli-" in done.stderr) == (4, True, False)
