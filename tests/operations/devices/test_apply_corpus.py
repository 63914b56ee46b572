"""The file of a node makes a fresh one equal, for every real EDS and DCF of a folder given with `--eds-corpus DIR`."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from tests.operations.devices.test_apply_file import makes_equal
from tests.operations.devices.test_silent_settings import is_not_silent
from tests.real_files import real_files


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    paths = real_files(metafunc.config)
    metafunc.parametrize("path", paths, ids=[path.name for path in paths])


def test_the_file_of_a_node_makes_a_fresh_one_equal(path: Path, tmp_path: Path) -> None:
    @settings(
        max_examples=2, database=None, derandomize=True, phases=(Phase.generate,)
    )  # a large file takes minutes to shrink
    @given(st.data())
    def law(data: st.DataObject) -> None:
        with TemporaryDirectory(dir=tmp_path) as folder:
            makes_equal(str(path), Path(folder), data.draw)

    law()


def test_what_a_node_holds_otherwise_is_a_difference_or_named(path: Path, tmp_path: Path) -> None:
    @settings(max_examples=3, database=None, derandomize=True, phases=(Phase.generate,))
    @given(st.data())
    def law(data: st.DataObject) -> None:
        with TemporaryDirectory(dir=tmp_path) as folder:
            is_not_silent(str(path), Path(folder), data.draw)

    law()
