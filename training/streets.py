"""Streets for the simulator's world files (docs/reference/simulator.md) that are fuller than those a seed makes up."""

from typing import Any, Dict, Sequence

import numpy as np

IN_ROWS = ("traffic_cone", "barrier")
"""Classes that stand one behind the other, up to four."""


def busy_street(rng: np.random.Generator, length_m: float, kinds: Sequence[str]) -> Dict[str, Any]:
    """A world file's content: a town whose road is full of hazards of the classes `kinds`, at the kerb and on the lanes."""
    hazards, at_m = [], 10.0
    while at_m < length_m:
        kind = str(rng.choice(kinds))
        side = -1 if rng.random() < 0.6 else 1
        for row in range(int(rng.integers(1, 5)) if kind in IN_ROWS else 1):
            hazards.append({
                "class": kind, "at_m": round(at_m + 2.5 * row, 2), "left_m": round(side * float(rng.uniform(2.2, 4.6)), 2),
            })
        at_m += float(rng.uniform(8, 20))
    return {
        "scene": {"buildings": bool(rng.random() < 0.9), "trees": bool(rng.random() < 0.9), "parked_cars": True},
        "hazards": sorted(hazards, key=lambda hazard: hazard["at_m"]),
    }
