# SPDX-License-Identifier: MIT
"""Columns of numbers for a page: small, and as exact as a screen can show.

Each column becomes whole numbers of 16 bits between its least and its largest value, 0 where it is
not known; then the differences from row to row, high bytes before low ones, which deflate packs
well. Numbers that are looked up stand as they are. The reader is `unpack` in assets/page.js.
"""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pelorus.wire.layout import Floats

STEPS = 65534  # between least and largest; 0 is unknown


@dataclass
class Packer:
    """Collects columns; `add` returns where the page finds one."""

    _parts: list[bytes] = field(default_factory=list)
    _bytes: int = 0

    def add(self, values: Floats) -> dict[str, Any]:
        """Adds a column that is drawn."""
        values = np.asarray(values, np.float64)
        known = np.isfinite(values)
        low, high = (float(f(values[known])) if known.any() else 0.0 for f in (np.min, np.max))
        span = high - low
        if not np.isfinite(span):  # beyond the range of a double
            known &= np.abs(values) < 1e300
            return self.add(np.where(known, values, np.nan))
        scale = STEPS / span if span else 0.0
        whole = np.where(known, np.round((np.where(known, values, low) - low) * scale) + 1, 0)
        steps = np.diff(whole, prepend=0).astype(np.int64)
        planes = b"".join((part & 0xFF).astype(np.uint8).tobytes() for part in (steps >> 8, steps))
        return self._put(planes, len(values)) | {"low": low, "step": span / STEPS}

    def add_exactly(self, values: Any, kind: str) -> dict[str, Any]:
        """Adds a column of numbers that are looked up: `kind` is u1, u2, u4 or f4."""
        return self._put(np.asarray(values).astype(f"<{kind}").tobytes(), len(values)) | {
            "kind": kind
        }

    def _put(self, content: bytes, count: int) -> dict[str, Any]:
        at = self._bytes
        pad = -len(content) % 4  # typed arrays are aligned to 4 bytes
        self._parts.append(content + bytes(pad))
        self._bytes += len(content) + pad
        return {"at": at, "count": count}

    def text(self) -> str:
        """Returns all columns, packed, in letters that need no escape in markup."""
        return base64.b64encode(zlib.compress(b"".join(self._parts), 6)).decode("ascii")
