"""`python -m tests.house.reference`: rewrite every generated part of README and the documentation."""

from __future__ import annotations

from tests.house.reference import pages, rewritten
from tests.process import ROOT

for page in pages():
    before = page.read_text("utf-8")
    after = rewritten(before)
    if after != before:
        page.write_text(after, encoding="utf-8")
        print(f"{page.relative_to(ROOT)} rewritten")
