"""The two directions in which a parameter is followed: up, and down again."""

from __future__ import annotations

from typing import Any

from mesoslip.plots.style import BLUE, RED

# Dimension of the directions.
DIRECTION = "direction"
# Colours, markers and sizes, so that both are seen where they agree.
STYLES: dict[str, dict[str, Any]] = {
    "up": {"color": RED, "marker": "^", "markersize": 6},
    "down": {"color": BLUE, "marker": "v", "markersize": 4},
}
