#!/usr/bin/python3
"""Event recall against false reports per km: single detections and tracked events.

    ./livemap evaluate detection DIR... --sweep --tracking --camera FILE --json > curve.json
    scripts/tracking_plot.py curve.json docs/pictures/tracking.png
"""

import json
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402  (the backend comes first)


def main():
    if len(sys.argv) < 3:
        sys.exit("usage: tracking_plot.py CURVE.json OUT.png [CLASS]")
    name = sys.argv[3] if len(sys.argv) > 3 else "pothole"
    with open(sys.argv[1], encoding="utf-8") as file:
        figures = json.load(file)["classes"][name]
    figure, axis = plt.subplots(figsize=(6, 4))
    for key, label, colour, marker in (("sweep", "single detections", "#D55E00", "s"),
                                       ("tracking", "tracked events", "#0072B2", "o")):
        points = [(row["false_per_km"], row["event_recall"]) for row in figures[key]]
        axis.plot(*zip(*points), color=colour, marker=marker, markersize=4, label=label)
    axis.set_xlim(0, 25)
    axis.set_ylim(0, 1)
    axis.set_xlabel("false reports per km")
    axis.set_ylabel("event recall at IoU 0.5")
    axis.set_title(f"{name}: {figures['events']} events, {figures['km']:.2f} km")
    axis.grid(True, alpha=0.3)
    axis.legend()
    figure.tight_layout()
    figure.savefig(sys.argv[2], dpi=100, metadata={"Software": None})


if __name__ == "__main__":
    main()
