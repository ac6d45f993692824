"""Files that are there whole or not at all."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def write_json(path: Path, document: Mapping[str, Any]) -> None:
    """Put a JSON document in its place: nobody finds half of one, whatever dies meanwhile. Raises OSError."""
    beside = path.with_name(f"{path.name}.part")
    beside.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    os.replace(beside, path)
