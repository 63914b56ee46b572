"""Profiles: listed, shown with their reasons, and the user's own in the configuration folder."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tests import process
from tests.process import ROOT, documents, environment
from tests.surroundings import homes, kept_in

PUMP = """like = "gen4"
name = "pump"
title = "Pump controller"
product_codes = [0x0705302D]      # what the simulated Gen4 says

[aliases]
pressure = "6C01:02"              # wired to analogue input 2
"""


def run(folder: Path, *words: str, stdin: str = "") -> subprocess.CompletedProcess[str]:
    """Run dvtcli with *folder* as the home of its settings."""
    return process.run(words, stdin=stdin, cwd=folder, env=environment() | homes(folder))


def own(folder: Path, text: str, name: str = "pump") -> Path:
    path = kept_in(folder) / "profiles" / f"{name}.toml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def test_the_list_has_every_profile_and_the_folder_for_one_s_own(tmp_path: Path) -> None:
    path = own(tmp_path, PUMP)
    (document,) = documents(run(tmp_path, "--json", "profiles").stdout)
    rows = {row["name"]: row for row in document["profiles"]}
    assert set(rows) >= {"generic", "gen4", "espac", "tmcm", "roboteq", "pump"}
    assert rows["pump"] == {
        "name": "pump", "title": "Pump controller", "vendor_ids": [0x1E], "file": str(path), "own": True
    }  # fmt: skip
    assert not rows["gen4"]["own"]
    assert document["folder"] == str(path.parent)
    assert "Pump controller" in run(tmp_path, "profiles").stdout


def test_a_profile_is_shown_with_the_reason_for_every_value(tmp_path: Path) -> None:
    for name in ("generic", "gen4", "espac", "tmcm", "roboteq", "curtis-reversed", "canopennode"):
        (document,) = documents(run(tmp_path, "--json", "profiles", "show", name).stdout)
        assert document["name"] == name
        assert document["values"]
        assert not [value["key"] for value in document["values"] if not value["reason"]], name
    shown = run(tmp_path, "profiles", "show", "tmcm").stdout
    assert "Trinamic AN076, 6.3: rw objects go into RPDOs only" in shown
    assert "assumed" in shown


def test_one_s_own_profile_is_shown_too(tmp_path: Path) -> None:
    own(tmp_path, PUMP)
    (document,) = documents(run(tmp_path, "--json", "profiles", "show", "pump").stdout)
    assert document["like"] == "gen4"
    assert {"key": "aliases.pressure", "value": '"6C01:02"', "reason": "wired to analogue input 2"} in document[
        "values"
    ]


def test_one_s_own_profile_is_taken_by_name(tmp_path: Path) -> None:
    own(tmp_path, PUMP)
    done = run(tmp_path, "--sim", "gen4", "-p", "pump", "--json", "map", "tpdo1", "pressure")
    assert done.returncode == 0, done.stdout + done.stderr
    assert documents(done.stdout)[0]["steps"][-3]["after"] == "10 02 01 6C"


def test_one_s_own_profile_is_found_by_identity(tmp_path: Path) -> None:
    own(tmp_path, PUMP)
    done = run(tmp_path, "--sim", "gen4-locked", "--json", stdin="node\nread pressure\n")
    nodes, value = documents(done.stdout)
    assert nodes["nodes"][0]["profile"] == "pump"
    assert value["object"] == "6C01:02"


def test_a_simulated_family_s_name_does_not_hide_one_s_own_profile(tmp_path: Path) -> None:
    own(tmp_path, PUMP)
    done = run(tmp_path, "--sim", "gen4", "--json", stdin="node\nread pressure\nread throttle\n")
    assert done.returncode == 0, done.stdout + done.stderr
    nodes, own_alias, alias_of_the_family = documents(done.stdout)
    assert nodes["nodes"][0]["profile"] == "pump"
    assert (own_alias["object"], alias_of_the_family["object"]) == ("6C01:02", "2220:00")


def test_an_eds_tells_the_family_of_a_device_that_does_not(tmp_path: Path) -> None:
    text = (ROOT / "dvtcli" / "families" / "gen4" / "gen4.eds").read_text("utf-8")
    start = text.index("[1018]")
    end = text.index("[", text.rindex("[1018sub") + 1)
    listed = text.replace(text[start:end], "").replace("=0x1018\n", "=0x1000\n")
    (tmp_path / "mute.eds").write_text(listed)
    done = run(tmp_path, "--sim", "mute.eds", "--json", stdin="read 1018:1\n")
    assert done.returncode == 1
    (node,) = documents(run(tmp_path, "--sim", "mute.eds", "--json", "node").stdout)[0]["nodes"]
    assert (node["vendor_id"], node["profile"]) == (None, "gen4")


@pytest.mark.parametrize(
    ("text", "place", "said"),
    [
        ("like = 'gen4'\nname = 'pump'\ntitle = 'P'\ngranularty = 8\n", ":4", "granularty: unknown key"),
        ("name = 'pump'\ntitle = 'P'\nmax_entries = 65\n", ":3", "max_entries: 65 is not within 1..64"),
        (
            "name = 'pump'\ntitle = 'P'\n[store]\ntimeout_s = 'x'\n",
            ":4",
            "store.timeout_s: must be a number of seconds",
        ),
        ("like = 'pump'\nname = 'pump'\ntitle = 'P'\n", ":1", "unknown built-in profile 'pump'"),
        ("name = 'pump'\n", ":1", "the key 'title' is missing"),
        ("name = 'other'\ntitle = 'P'\n", "", "the profile is called 'other', and its file pump.toml"),
        ("name = \n", ":1", "Invalid value"),
        ("name = '\xff'\n", "", "pump.toml"),
    ],
)
def test_a_wrong_profile_is_an_error_with_line_and_key(tmp_path: Path, text: str, place: str, said: str) -> None:
    path = own(tmp_path, "")
    path.write_bytes(text.encode("latin-1"))
    for words in (("profiles", "show", "pump"), ("--sim", "gen4", "-p", "pump", "pdo")):
        done = run(tmp_path, *words)
        assert done.returncode == 4, done.stderr
        assert said in done.stderr
        assert f"{path}{place}" in "".join(line.strip() for line in done.stderr.splitlines())
        done = run(tmp_path, "--json", *words)
        assert documents(done.stdout)[0]["file"].startswith(f"{path}{place}")


def test_an_unknown_profile_gets_the_nearest_name(tmp_path: Path) -> None:
    own(tmp_path, PUMP)
    for words in (("profiles", "show", "pumpe"), ("--sim", "gen4", "-p", "pumpe", "pdo")):
        done = run(tmp_path, *words)
        assert done.returncode == 2
        assert "did you mean 'pump'?" in done.stderr
    assert run(tmp_path, "profiles", "show").returncode == 2
