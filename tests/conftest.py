"""Options of the test run."""

from __future__ import annotations

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--eds-corpus", metavar="DIR", help="folder of real EDS and DCF files to read; none: skipped")
