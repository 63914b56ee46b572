"""What a journal says, as a document that a test may alter."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from dvtcli.device.change.journal import content_of


def journal_document(path: Path) -> dict[str, Any]:
    """The document of the journal at *path*."""
    document: dict[str, Any] = json.loads(content_of(path.read_bytes()))
    return document
