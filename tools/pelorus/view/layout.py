# SPDX-License-Identifier: MIT
"""A layout for Foxglove that shows what `view --mcap` writes, to be imported there."""

from __future__ import annotations

import json
from typing import Any

SCENE, IMAGE, LOG = "3D!pelorus", "Image!pelorus", "RosOut!pelorus"
# title, and the curves in it: topic, numbers
PLOTS = (
    ("Innovations", (("innovations", "NIS of a degree of freedom"),)),
    ("Sigma", (("sigma", "position, m"), ("sigma", "rotation, deg"))),
    ("Points", (("points", "observations"), ("points", "used"), ("points", "gated"))),
    ("Doubt", (("doubt", "statistic"), ("odometry", "weight"), ("odometry", "agreement"))),
)
TOPICS = ("odometry", "scene", "truth")


def layout() -> str:
    """Returns the layout as JSON."""
    panels: dict[str, Any] = {
        SCENE: {
            "followTf": "world",
            "topics": {f"/pelorus/{name}": {"visible": True} for name in TOPICS},
        },
        IMAGE: {
            "imageMode": {
                "calibrationTopic": "/pelorus/calibration",
                "annotations": {"/pelorus/points": {"visible": True}},
            }
        },
        LOG: {"topicToRender": "/pelorus/health"},
    }
    panels |= {f"Plot!pelorus{k}": _plot(*plot) for k, plot in enumerate(PLOTS)}
    plots = [name for name in panels if name.startswith("Plot")]
    beside = _split("column", SCENE, _split("row", IMAGE, LOG), 65)
    whole = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split("row", beside, _stacked(plots), 60),
    }
    return json.dumps(whole, indent=2) + "\n"


def _plot(title: str, curves: tuple[tuple[str, str], ...]) -> dict[str, Any]:
    return {
        "foxglovePanelTitle": title,
        "paths": [
            {
                "value": f'/pelorus/curves/{topic}."{name}"',
                "label": name,
                "enabled": True,
                "timestampMethod": "receiveTime",
            }
            for topic, name in curves
        ],
        "xAxisVal": "timestamp",
        "showLegend": True,
        "isSynced": True,
    }


def _split(direction: str, first: Any, second: Any, percent: int = 50) -> dict[str, Any]:
    return {
        "direction": direction,
        "first": first,
        "second": second,
        "splitPercentage": percent,
    }


def _stacked(names: list[str]) -> Any:
    """Returns panels one above the other, of equal height."""
    head, *rest = names
    return _split("column", head, _stacked(rest), round(100 / len(names))) if rest else head
