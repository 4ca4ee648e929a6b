"""Files that appear whole or not at all, in a folder that is known to be writable."""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
from pathlib import Path
from typing import Any


def require_writable(folder: Path) -> None:
    """Before the work, not after it; nothing is created yet.

    Raises:
        ValueError: Nothing can be written there; the message names --out and the reason.
    """
    existing = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    try:
        with tempfile.TemporaryFile(dir=existing):
            pass
    except OSError as error:
        raise ValueError(f"--out {folder}: cannot be written ({error.strerror})") from None


def write_json(path: Path, record: dict[str, Any]) -> None:
    """Whole; JSON has no infinity and no NaN, and neither may the record.

    Raises:
        ValueError: It has.
    """
    text = json.dumps(record, indent=1, allow_nan=False)
    write_whole(path, f"{text}\n".encode())


def write_whole(path: Path, content: bytes) -> None:
    """Under a temporary name beside it, then renamed; its folder is made where there is none."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise
