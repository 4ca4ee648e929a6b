"""Real products for tests: a folder beside the project, which not everybody has."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

FOLDER = Path(
    os.environ.get("PRODUCTS", Path(__file__).resolve().parents[2] / "shared" / "data" / "objects")
)
PRODUCTS = tuple(sorted(path.stem for path in FOLDER.glob("*.json")))

needs_products = pytest.mark.skipif(not PRODUCTS, reason=f"no real products in {FOLDER}")


def product(name: str) -> Path:
    return FOLDER / f"{name}.json"
