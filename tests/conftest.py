"""Options of the test run."""

from __future__ import annotations

import pytest
from hypothesis import settings

#: `pytest --hypothesis-profile=thorough` looks at thirty times as many examples of every law.
settings.register_profile("thorough", max_examples=3000, deadline=None)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--eds-corpus", metavar="DIR", help="folder of real EDS and DCF files to read; none: skipped")
    parser.addoption(
        "--update-transcripts", action="store_true", help="rewrite golden sessions with what is printed now"
    )
    parser.addoption("--serve-frames", type=int, default=8000, metavar="N", help="frames to 4 clients of sim [8000]")
    parser.addoption("--fuzz", type=int, default=20_000, metavar="N", help="hostile inputs in all [20000]")
