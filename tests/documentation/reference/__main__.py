"""`python -m tests.documentation.reference`: rewrite all that is generated of README and the documentation."""

from __future__ import annotations

from tests.documentation.reference import BUILT, pages, rewritten
from tests.documentation.reference.house import DRAWING, drawing
from tests.documentation.reference.network import SCHEMA_FILES, schema_text
from tests.documentation.reference.sample_report import SAMPLE, sample_report
from tests.documentation.reference.screens import picture, pictured
from tests.surroundings import ROOT

for page in pages():
    before = page.read_text("utf-8")
    after = rewritten(before)
    if after != before:
        page.write_text(after, encoding="utf-8")
        print(f"{page.relative_to(ROOT)} rewritten")

for page, around in BUILT.items():
    page.write_text(rewritten(around.read_text("utf-8")), encoding="utf-8")
    print(f"{page.relative_to(ROOT)} written")

for path in SCHEMA_FILES:
    if not path.exists() or path.read_text("utf-8") != schema_text():
        path.write_text(schema_text(), encoding="utf-8")
        print(f"{path.relative_to(ROOT)} rewritten")

if not DRAWING.exists() or DRAWING.read_text("utf-8") != drawing():
    DRAWING.write_text(drawing(), encoding="utf-8")
    print(f"{DRAWING.relative_to(ROOT)} rewritten")

for path, name in pictured(pages()).items():
    if not path.exists() or path.read_text("utf-8") != picture(name):
        path.write_text(picture(name), encoding="utf-8")
        print(f"{path.relative_to(ROOT)} rewritten")

if not SAMPLE.exists() or SAMPLE.read_text("utf-8") != sample_report():
    SAMPLE.write_text(sample_report(), encoding="utf-8")
    print(f"{SAMPLE.relative_to(ROOT)} rewritten")
