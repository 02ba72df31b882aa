"""The plots of visual odometry's page."""

import math
import statistics

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402  (the backend comes first)

# Told apart by colour-blind readers too (Okabe and Ito), and by their markers.
COLOURS = {"edge": "#0072B2", "rgbd": "#D55E00", "rgbd-icp": "#009E73", "truth": "#000000"}
MARKERS = {"edge": "o", "rgbd": "s", "rgbd-icp": "^"}
NAMES = {"edge": "LiveMap", "rgbd": "RgbdOdometry", "rgbd-icp": "RgbdICPOdometry"}
WIDTH_IN, HEIGHT_IN, DPI = 9, 3.4, 100


def save(figure, path):
    figure.tight_layout()
    figure.savefig(path, dpi=DPI, metadata={"Software": None})
    plt.close(figure)


def panels(rows, columns):
    figure, axes = plt.subplots(rows, columns, figsize=(WIDTH_IN, HEIGHT_IN * rows), squeeze=False)
    for axis in axes.flat:
        axis.grid(True, alpha=0.3)
    return figure, axes


def line_through(rows):
    """Slope and intercept of the line through tracked_ms over points that has the least squares of its relative
    errors, and the greatest of these."""
    points = [(row["points"], row["tracked_ms"]) for row in rows if row["points"] and row["tracked_ms"]]
    weights = [1 / y**2 for _, y in points]
    mean_x, mean_y = (sum(w * value for w, value in zip(weights, values)) / sum(weights) for values in zip(*points))
    spread_x = sum(w * (x - mean_x) ** 2 for w, (x, _) in zip(weights, points))
    slope = sum(w * (x - mean_x) * (y - mean_y) for w, (x, y) in zip(weights, points)) / spread_x
    intercept = mean_y - slope * mean_x
    return slope, intercept, max(abs((intercept + slope * x) / y - 1) for x, y in points)


def scale_errors(axis, most, least):
    """From zero; logarithmic where lost runs are much worse than the others."""
    if least > 0 and most > 10 * least:
        axis.set_yscale("log")
        axis.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    else:
        axis.set_ylim(0, 1.05 * most)


def draw_ablation(sequences, path):
    chosen = [s for s in sequences if "ablation" in s]
    figure, axes = panels(1, len(chosen))
    for axis, sequence in zip(axes.flat, chosen):
        drawn = []
        for pixels, colour, marker in (("edges", COLOURS["edge"], "o"), ("random", COLOURS["rgbd"], "s")):
            rows = [row for row in sequence["ablation"]["rows"]
                    if row["pixels"] == pixels and row["ate_rmse_m"] is not None]
            shares = sorted({row["share"] for row in rows})
            runs = [[1000 * row["ate_rmse_m"] for row in rows if row["share"] == share] for share in shares]
            drawn += [error for run in runs for error in run]
            percent = [100 * share for share in shares]
            axis.plot(percent, [statistics.mean(run) for run in runs], color=colour, marker=marker,
                      label="edge pixels" if pixels == "edges" else "as many random pixels")
            axis.fill_between(percent, [min(run) for run in runs], [max(run) for run in runs], color=colour, alpha=0.2)
        axis.set(title=sequence["name"], xlabel="share of the edge pixels (%)", ylabel="ATE (mm)")
        if drawn:
            scale_errors(axis, max(drawn), min(drawn))
        axis.legend()
    save(figure, path)


def draw_pixels(sequences, path):
    chosen = [s for s in sequences if "pixels" in s]
    figure, axes = panels(1, len(chosen))
    for axis, sequence in zip(axes.flat, chosen):
        rows = [row for row in sequence["pixels"]["rows"] if row["points"] and row["tracked_ms"]]
        for pixels, colour, marker in (("edges", COLOURS["edge"], "o"), ("random", COLOURS["rgbd"], "s")):
            own = [row for row in rows if row["pixels"] == pixels]
            axis.plot([row["points"] / 1000 for row in own], [row["tracked_ms"] for row in own], color=colour,
                      marker=marker, linestyle="", label="edge pixels" if pixels == "edges" else "pixels from anywhere")
        slope, intercept, _ = line_through(rows)
        counts = sorted(row["points"] for row in rows)
        axis.plot([count / 1000 for count in counts], [intercept + slope * count for count in counts],
                  color="#888888", linewidth=1, zorder=0,
                  label=f"{intercept:.2f} ms + {1000 * slope:.3f} us per pixel")
        axis.set(title=sequence["name"], xlabel="pixels of the finest level (thousands)", ylabel="tracked frame (ms)",
                 xscale="log", yscale="log")
        for numbered in (axis.xaxis, axis.yaxis):
            numbered.set_major_formatter(lambda value, _: f"{value:g}")
        axis.legend()
    save(figure, path)


def draw_basin(sequences, path):
    chosen = [s for s in sequences if "basin" in s]
    if not chosen:
        return
    figure, axes = panels(len(chosen), 2)
    kinds = (("translation_m", "rotation_deg", 1000, "guess off by (mm)"),
             ("rotation_deg", "translation_m", 1, "guess off by (degrees)"))
    for line, sequence in zip(axes, chosen):
        for axis, (key, other, unit, label) in zip(line, kinds):
            rows = [row for row in sequence["basin"]["rows"] if not row[other]]
            for method, colour in ((m, COLOURS[m]) for m in NAMES):
                axis.plot([unit * row[key] for row in rows], [100 * row[method] for row in rows], color=colour,
                          marker=MARKERS[method], label=NAMES[method])
            axis.set(title=sequence["name"], xlabel=label, ylabel="converged (%)", ylim=(-4, 104))
    axes[0][0].legend()
    save(figure, path)


def with_paths(sequences):
    return [s for s in sequences if s["kind"] != "generated" and s["tables"]["paths"] and
            len(s["tables"]["paths"]["time_s"]) > 20][:5]


def draw_paths(sequences, path):
    """Each sequence's path in the plane where it is widest, and the errors over time."""
    chosen = with_paths(sequences)
    if not chosen:
        return
    figure, axes = panels(len(chosen), 2)
    for (plan, errors), sequence in zip(axes, chosen):
        paths = sequence["tables"]["paths"]
        truth = list(zip(*paths["truth"]))
        widest = sorted(sorted(range(3), key=lambda axis: min(truth[axis]) - max(truth[axis]))[:2])
        for method, style, width in (("rgbd", "-", 1.5), ("edge", "-", 2.6), ("truth", "--", 1.2)):
            plan.plot(*([at[axis] for at in paths[method]] for axis in widest), style, color=COLOURS[method],
                      linewidth=width, label=NAMES.get(method, "truth"))
        plan.set(title=sequence["name"], xlabel=f"{'xyz'[widest[0]]} (m)", ylabel=f"{'xyz'[widest[1]]} (m)")
        plan.axis("equal")
        for method in ("rgbd", "edge"):
            errors.plot(paths["time_s"], [1000 * max(math.dist(at, true), 1e-5)
                                          for at, true in zip(paths[method], paths["truth"])],
                        color=COLOURS[method], linewidth=1.5, label=NAMES[method])
        errors.set(title=sequence["name"], xlabel="time (s)", ylabel="error (mm)", yscale="log")
        errors.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes[0][0].legend(fontsize="small")
    save(figure, path)


def draw_all(sequences, out):
    draw_ablation(sequences, out / "odometry_ablation.png")
    draw_pixels(sequences, out / "odometry_pixels.png")
    draw_basin(sequences, out / "odometry_basin.png")
    draw_paths(sequences, out / "odometry_paths.png")
