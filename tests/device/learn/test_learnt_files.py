"""Every EDS of a folder (`--eds-corpus`) as a device: learnt, it answers the same, and nothing is left behind."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.operations.session.simulated_nodes import simulated_device, simulated_nodes
from dvtcli.simulator.network.family_file import family_eds, load_family_folder
from tests.cli.commands.bench import Bench
from tests.device.learn.test_learnt_families import differing, dump
from tests.harness.sample import part
from tests.real_files import real_files


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    count = max(1, metafunc.config.getoption("--learn") // 4)
    ours = part([family_eds(name) for name in ("lely", "roboteq")], count, metafunc.config, "files that are learnt")
    paths = [*ours, *real_files(metafunc.config)]
    metafunc.parametrize("path", paths, ids=[path.name for path in paths])


@pytest.mark.counted
def test_a_file_that_is_learnt_answers_the_same(path: Path) -> None:
    original = simulated_device(*simulated_nodes((str(path),))).family
    with Bench((str(path),), {"profile": "generic"}) as bench:
        before = dump(bench)
        ran = bench.run("learn --isolated --yes --save pump --json")
        if ran.code == 1 and ran.document["error"] == "device_refused":
            assert ran.document["state"] == "unchanged"
            pytest.skip(ran.document["text"])
        assert ran.code == 0, (ran.stdout, ran.stderr)
        assert dump(bench) == before
    found, asked = differing(path, original, load_family_folder(Path("pump")))
    assert asked >= 60
    assert not found
