"""Every format that `export` has is told by its help, writes a file, and says what is not in it."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.operations.exchange.export_file import ExportFormat, export_formats
from tests.bus.devices import unknown
from tests.cli.commands.bench import Bench
from tests.process import ROOT, documents, dvtcli
from tests.virtual_time import VirtualTimeBus

PLACE = "dvtcli/cli/commands/export.py"


def test_help_names_every_format() -> None:
    told = dvtcli("help", "export").stdout
    silent = {one.suffixes[0] for one in export_formats().values() if one.suffixes[0] not in told}
    assert not silent, f"name {' '.join(sorted(silent))} in the help in {PLACE}"


@pytest.mark.parametrize("suffix", export_formats())
def test_it_writes_what_a_node_holds(tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"node{suffix}"
    ran = dvtcli("--sim", "gen4", "--json", "export", str(file))
    assert ran.returncode == 0, ran
    assert file.stat().st_size > 100
    (said,) = documents(ran.stdout)
    assert said["file"] == str(file)
    assert {"left_out", "notes"} & said.keys(), f"the answer of {suffix} lacks the row left_out"


def test_a_format_lacks_no_suffix() -> None:
    with pytest.raises(TypeError, match=r"Nameless needs a line such as suffixes = \(\"\.yaml\",\)"):

        class Nameless(ExportFormat):
            """One that nobody finds."""


def test_a_suffix_that_is_no_format_is_said_with_all_that_are(tmp_path: Path) -> None:
    with Bench(("gen4@1",)) as bench:
        ran = bench.run(f"export {tmp_path / 'y.foo'}")
    ran.failed(2, "unknown format")
    assert all(suffix in ran.stderr for suffix in (".yaml", ".dcf", ".xdc", ".cpj", ".dbc"))


def test_a_report_whose_names_are_the_other_way_round_is_said_with_the_line_that_runs(tmp_path: Path) -> None:
    page, file = tmp_path / "line.html", ROOT / "examples" / "line.yaml"
    with Bench(()) as bench:
        ran = bench.run(f"report {file} {page}")
        ran.failed(2, f"report {page} {file}")
        assert bench.run(f"report {page} {file}").code == 0


def test_a_dbc_file_of_nodes_without_an_eds_has_a_warning(tmp_path: Path) -> None:
    """Their values have no sign in it, which nobody sees in the file."""
    bus = VirtualTimeBus([unknown(1)], simulated=False)
    with Bench((), {"node": (1,), "journal": str(tmp_path)}, bus) as bench:
        ran = bench.run(f"export {tmp_path / 'a.dbc'}")
    assert ran.code == 0, ran.stderr
    assert "warning: no EDS of node 1: without one, signals have no names, signs or units" in ran.stderr
