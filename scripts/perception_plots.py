"""The plots of perception's page."""

import math

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402  (the backend comes first)

# Told apart by colour-blind readers too (Okabe and Ito), and by their markers.
BIG, SMALL, PERFECT, STREAM, THESIS = "#0072B2", "#D55E00", "#009E73", "#CC0000", "#999999"
SIZE_IN, DPI = (7.5, 4.6), 100


def save(figure, path):
    figure.tight_layout()
    figure.savefig(path, dpi=DPI, metadata={"Software": None})
    plt.close(figure)


def draw_uplink(points, stream_mbit_s, path):
    """Figure 3.6: uplink against event recall. A point: label, kind, recall and mbit_s."""
    figure, axis = plt.subplots(figsize=SIZE_IN)
    big = [point for point in points if point["kind"] == "big"]
    axis.plot([p["recall"] for p in big], [p["mbit_s"] for p in big], "-o", color=BIG,
              label="BVC, by radius of duplicates")
    for point in big:
        axis.annotate(point["label"], (point["recall"], point["mbit_s"]), textcoords="offset points", xytext=(6, 5),
                      fontsize=8)
    for kind, colour, marker, label in (("small", SMALL, "s", "SVC + zone"),
                                        ("perfect", PERFECT, "*", "perfect detector, 5 m")):
        for point in (p for p in points if p["kind"] == kind):
            axis.plot(point["recall"], point["mbit_s"], marker, color=colour, markersize=13 if marker == "*" else 8,
                      linestyle="none", label=label)
    if stream_mbit_s:
        axis.axhline(stream_mbit_s, color=STREAM, label="H.264 stream of the same frames")
    for label, marker, recall, mbit_s in (("thesis: BVC, 5 m", "o", 0.923, 0.46), ("thesis: SVC", "s", 0.846, 0.91)):
        axis.plot(recall, mbit_s, marker, color=THESIS, markerfacecolor="none", linestyle="none", label=label)
    axis.set_yscale("log")
    axis.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_xlim(0, 1.03)
    axis.set_xlabel("event recall (IoU 0.5)" if all(p["by"] == "events" for p in points)
                    else "hazards found on the map (within 5 m)")
    axis.set_ylabel("uplink (Mbit/s)")
    axis.grid(True, which="both", alpha=0.3)
    axis.legend(fontsize=8, loc="center left" if stream_mbit_s else "best")
    save(figure, path)


STAGES = (("discard", "early discard"), ("detection", "detection"), ("placing", "placing, picture"),
          ("round_trip", "round trip"), ("to_zone", "link and zone"))


def draw_latency(rows, path):
    """Table 3.1 as bars: means per stage, beside each other as they follow each other."""
    figure, axis = plt.subplots(figsize=(SIZE_IN[0], 0.9 + 0.7 * len(rows)))
    colours = dict(zip((name for name, _ in STAGES), ("#56B4E9", BIG, "#E69F00", PERFECT, SMALL)))
    for y, row in enumerate(reversed(rows)):
        left = 0.0
        for name, label in STAGES:
            figures = row["stages"].get(name)
            # In the zone the detection is a part of the way there.
            if not figures or math.isnan(figures["mean"]) or (row["profile"] == "small" and name == "detection"):
                continue
            axis.barh(y, figures["mean"], left=left, color=colours[name],
                      label=label if label not in axis.get_legend_handles_labels()[1] else None)
            left += figures["mean"]
    axis.set_yticks(range(len(rows)), [row["name"] for row in reversed(rows)])
    axis.set_xlabel("ms, means")
    axis.grid(True, axis="x", alpha=0.3)
    axis.legend(fontsize=8)
    save(figure, path)
