"""The plots of perception's page."""

import math

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402  (the backend comes first)
from matplotlib.ticker import LogLocator, NullFormatter  # noqa: E402

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
        axis.annotate(point["label"], (point["recall"], point["mbit_s"]), textcoords="offset points", xytext=(9, -3),
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
    axis.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.yaxis.set_minor_formatter(NullFormatter())
    axis.set_xlim(0, 1.03)
    axis.set_xlabel("event recall (IoU 0.5)" if all(p["by"] == "events" for p in points)
                    else "hazards found on the map (within 5 m)")
    axis.set_ylabel("uplink (Mbit/s)")
    axis.grid(True, which="both", alpha=0.3)
    axis.legend(fontsize=8, loc="center left" if stream_mbit_s else "best")
    save(figure, path)


STAGES = (("discard", "early discard"), ("detection", "detection"), ("placing", "placing, picture"),
          ("round_trip", "round trip"), ("to_zone", "round trip and the zone's detection"))
STAGE_COLOURS = ("#56B4E9", BIG, "#E69F00", PERFECT, SMALL)


def draw_bar(axis, y, parts):
    """Means beside each other as they follow each other; returns where they end."""
    left = 0.0
    for width, label, style in parts:
        known = axis.get_legend_handles_labels()[1]
        axis.barh(y, width, left=left, label=None if label in known else label, **style)
        left += width
    return left


def parts_of(row):
    """The stages of a row that follow each other, and what waiting leaves between them."""
    # In the zone the detection is a part of the way there.
    wanted = [(name, label, colour) for (name, label), colour in zip(STAGES, STAGE_COLOURS)
              if not (row["profile"] == "small" and name == "detection")]
    found = [(row["stages"][name]["mean"], label, {"color": colour}) for name, label, colour in wanted
             if row["stages"].get(name) and not math.isnan(row["stages"][name]["mean"])]
    whole = row["stages"].get("end_to_end")
    waiting = whole["mean"] - sum(width for width, _, _ in found) if whole else 0.0
    if waiting > 0:
        found.append((waiting, "waiting between them", {"facecolor": "white", "edgecolor": THESIS, "hatch": "///"}))
    return found


def draw_latency(rows, thesis, path):
    """Table 3.1 as bars of means. thesis: name, detection and round trip of its rows."""
    count = len(rows) + len(thesis)
    figure, axis = plt.subplots(figsize=(SIZE_IN[0], 1.6 + 0.5 * count))
    for y, row in zip(range(count - 1, -1, -1), rows):
        draw_bar(axis, y, parts_of(row))
    for y, (_, detection, round_trip) in zip(range(len(thesis) - 1, -1, -1), thesis):
        draw_bar(axis, y, ((detection, "detection", {"color": BIG}), (round_trip, "round trip", {"color": PERFECT})))
    axis.set_yticks(range(count - 1, -1, -1), [row["name"] for row in rows] + [name for name, _, _ in thesis])
    axis.set_xlabel("ms, means")
    axis.grid(True, axis="x", alpha=0.3)
    axis.legend(fontsize=8, ncol=3, loc="upper center", bbox_to_anchor=(0.4, -0.18))
    save(figure, path)
