"""The page of visual odometry's figures: tables of what livemap_measure_vo measured, and what they say."""

import statistics
import textwrap

import vo_plots

KINDS = ("canny", "log", "sobel", "structured")
RULES = (("adaptive", "KF"), ("every-5", "K5"), ("frame-to-frame", "FF"))
OPENCV = (("rgbd", "OpenCV RgbdOdometry"), ("rgbd-icp", "OpenCV RgbdICPOdometry"))
TIME_BAR = 0.13
# Per sequence: measure, key, unit, bar, earlier figures of others on it.
BARS = {
    "seven_scenes_a": (("ATE", "ate_rmse_m", "m", 0.024, "author's 0.0266, OpenCV's 0.0239, REVO's 0.0321"),
                       ("RPE", "rpe_rmse_m_per_s", "m/s", 0.039, "author's 0.0392, OpenCV's 0.0396, REVO's 0.0437")),
    "realsense_sample": (("ATE", "ate_rmse_m", "m", 0.030, "author's 0.0441, OpenCV's 0.1116"),),
    "room": (("ATE", "ate_rmse_m", "m", 0.002, "a like room: author's 0.0149, OpenCV's 0.0277, REVO's 0.0025"),
             ("RPE", "rpe_rmse_m_per_s", "m/s", 0.003, "a like room: author's 0.0171, OpenCV's 0.0285, REVO's 0.0035")),
}


def row_of(sequence, method, edges="canny", source="keyframe", rule="adaptive"):
    """The row of one method; None where it was not measured."""
    for row in sequence["tables"]["rows"]:
        if row["method"] != method:
            continue
        if method != "edge" or (row["edges"], row["source"], row["keyframe_rule"]) == (edges, source, rule):
            return row
    return None


def number(value, digits=4):
    return "-" if value is None else f"{value:.{digits}f}"


def prose(text):
    """A paragraph of its own."""
    return "\n" + textwrap.fill(" ".join(text.split()), 100, break_long_words=False, break_on_hyphens=False) + "\n"


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]) + "\n"


def bold_least(values, digits):
    """The cells of a row, the least in bold."""
    known = [round(value, digits) for value in values if value is not None]
    least = min(known) if known else None
    return [f"**{number(value, digits)}**" if value is not None and round(value, digits) == least
            else number(value, digits) for value in values]


def time_ratio(sequence):
    return row_of(sequence, "edge")["median_ms"] / row_of(sequence, "rgbd")["median_ms"]


def bar_rows(sequences):
    rows = []
    for sequence in sequences:
        if sequence["kind"] == "your own":
            continue
        for measure, key, unit, bar, others in BARS.get(sequence["name"], ()):
            value, rgbd = row_of(sequence, "edge")[key], row_of(sequence, "rgbd")[key]
            verdict = "holds" if value is not None and value <= bar else "**missed**"
            rows.append([sequence["name"], f"{measure} ({unit})", number(bar, 3), number(value), verdict, number(rgbd),
                         others])
    for sequence in sequences:
        ratio = time_ratio(sequence)
        rows.append([sequence["name"], "time / RgbdOdometry's", TIME_BAR, number(ratio, 3),
                     "holds" if ratio <= TIME_BAR else "**missed**", "1", ""])
    return rows


def better_ones(sequences):
    """Where one of OpenCV's methods has the smaller error."""
    found = []
    for sequence in sequences:
        ours = row_of(sequence, "edge")["ate_rmse_m"]
        for method, name in OPENCV:
            theirs = row_of(sequence, method)["ate_rmse_m"]
            if None not in (ours, theirs) and round(theirs, 4) < round(ours, 4):
                found.append(f"{sequence['name']} ({name} {number(theirs)} m, LiveMap {number(ours)} m)")
    if not found:
        return prose("Neither of OpenCV's methods has a smaller ATE than LiveMap's defaults on any of the sequences.")
    return prose(f"""One of OpenCV's methods has a smaller ATE than LiveMap's defaults on: {"; ".join(found)}.
        RgbdICPOdometry aligns the depths as well: where they are exact and the scene has shape, as in the simulated
        room, that is worth much.""")


def bars_section(sequences):
    text = "## The bars\n" + table(
        ["sequence", "measure", "bar", "LiveMap", "", "OpenCV RgbdOdometry, this run", "earlier figures of others"],
        bar_rows(sequences))
    missed = [sequence for sequence in sequences if time_ratio(sequence) > TIME_BAR]
    if missed:
        shares = ", ".join(f"{s['name']} {share_of_keyframes(s):.0%}" for s in missed)
        text += prose(f"""Where the bar of time is missed, look at the share of frames that became keyframes, which
            cost their edges, depth and Jacobians too ({shares}), and at OpenCV's own time: it leaves out depth
            beyond 4 m and is quick where there is much of it.""")
    return text + better_ones(sequences) + prose("""LiveMap is Canny edges of adaptive keyframes, the defaults. The
        earlier figures (the thesis author's program, OpenCV, REVO) come with the bars; they are not of this run,
        and those of the room are of another rendering.""")


def share_of_keyframes(sequence):
    return row_of(sequence, "edge")["keyframes"] / sequence["tables"]["frames"]


def sequences_section(sequences, missing):
    rows = [[s["name"], s["kind"], s["tables"]["frames"], f"{s['tables']['width']}x{s['tables']['height']}",
             number(s["tables"]["length_m"], 2) if s["tables"]["frames_with_truth"] > 1 else "no truth",
             "not known" if s["kind"] == "your own" else "yes", s["source"]] for s in sequences]
    text = "## Sequences\n" + table(["name", "kind", "frames", "size", "path (m)", "looked at while tuning", "from"],
                                    rows)
    if missing:
        text += f"\nSkipped, no data: {', '.join(missing)}.\n"
    return text


def accuracy_columns(sequences):
    kinds = [kind for kind in KINDS if any(row_of(s, "edge", kind) for s in sequences)]
    columns = [("edge", kind, rule, f"{kind} {short}") for rule, short in RULES for kind in kinds]
    return columns + [(method, None, None, name) for method, name in OPENCV]


def accuracy_table(sequences, key, digits):
    columns = accuracy_columns(sequences)
    rows = []
    for sequence in sequences:
        for source in ("keyframe", "new-image"):
            values = [row_of(sequence, method, kind, source, rule)[key] if method == "edge"
                      else row_of(sequence, method)[key] for method, kind, rule, _ in columns]
            if any(value is not None for value in values):
                rows.append([sequence["name"], "keyframe's" if source == "keyframe" else "new image's",
                             *bold_least(values, digits)])
    return table(["sequence", "edges of", *(name for _, _, _, name in columns)], rows)


def accuracy_section(sequences, structured):
    text = "## Kinds of edges and keyframes\n" + prose("""The thesis's table 5.1. KF: adaptive keyframes; K5: one
        every 5 frames; FF: frame to frame. *Edges of*: whose edges choose the pixels, the keyframe's own or, as in
        the thesis, the new image's as a mask on it. The least of each row is bold. RPE is over 1 s; sequences
        shorter than that have none.""")
    if not structured:
        text += prose("Structured edges need OpenCV's model (`--edge-model FILE`), which was not given: not measured.")
    for title, key, digits in (("Relative pose error (m/s)", "rpe_rmse_m_per_s", 4),
                               ("Relative pose error (deg/s)", "rpe_rmse_deg_per_s", 3),
                               ("Absolute trajectory error (m)", "ate_rmse_m", 4)):
        text += f"\n### {title}\n" + accuracy_table(sequences, key, digits)
    lost = [f"{s['name']}: {describe(row)} {row['lost']} of {s['tables']['frames']}"
            for s in sequences for row in s["tables"]["rows"] if row["lost"]]
    text += prose("Lost frames: " + ("; ".join(lost) if lost else "none") + ".")
    return text + sources_sentence(sequences)


def describe(row):
    if row["method"] != "edge":
        return row["method"]
    whose = "" if row["source"] == "keyframe" else " of the new image"
    return f"{row['edges']}{whose} {dict(RULES)[row['keyframe_rule']]}"


def sources_sentence(sequences):
    """Counts in how many cells of the table each source of edges is the better one."""
    better = {"keyframe": 0, "new-image": 0}
    for sequence in sequences:
        for kind in KINDS:
            for rule, _ in RULES:
                rows = {source: row_of(sequence, "edge", kind, source, rule) for source in better}
                values = {source: row and row["rpe_rmse_m_per_s"] for source, row in rows.items()}
                if None not in values.values() and values["keyframe"] != values["new-image"]:
                    better[min(values, key=values.get)] += 1
    return prose(f"""The keyframe's own edges have the smaller RPE in {better['keyframe']} of the
        {sum(better.values())} comparisons, the new image's in {better['new-image']}; the latter need edges of every
        frame (see the times).""")


def time_section(sequences):
    columns = (("canny KF", ("edge",)), ("canny K5", ("edge", "canny", "keyframe", "every-5")),
               ("canny FF", ("edge", "canny", "keyframe", "frame-to-frame")),
               ("canny KF, new image's edges", ("edge", "canny", "new-image")), ("log KF", ("edge", "log")),
               ("sobel KF", ("edge", "sobel")), ("RgbdOdometry", ("rgbd",)), ("RgbdICPOdometry", ("rgbd-icp",)))
    rows = []
    for sequence in sequences:
        cells = [row_of(sequence, *key) for _, key in columns]
        rows.append([sequence["name"], sequence["tables"]["frames"],
                     *(f"{cell['median_ms']:.2f} ({cell['p95_ms']:.2f})" for cell in cells),
                     f"{share_of_keyframes(sequence):.0%}", f"{time_ratio(sequence):.3f}"])
    return "## Time\n" + prose("""Milliseconds of processor time per frame, median (95th percentile), from the decoded
        colour picture to the pose, one thread. *Ratio*: canny KF to RgbdOdometry; *keyframes*: share of the frames
        that became one with canny KF. Every frame is given to all methods in turn, so that the machine's other work
        meets all alike and each finds cold caches. On a busy machine all need more processor time than on a quiet
        one; the ratio is what to compare.""") + "\n" + table(
            ["sequence", "n", *(name for name, _ in columns), "keyframes", "ratio"], rows)


def spread(values):
    values = [value for value in values if value is not None]
    if not values:
        return "-"
    return f"{statistics.mean(values):.4f} ({min(values):.4f}-{max(values):.4f})"


def ablation_sentence(rows):
    """At how many shares edges have the smaller mean error."""
    shares = sorted({row["share"] for row in rows})
    means = {(share, pixels): [row["ate_rmse_m"] for row in rows
                               if row["share"] == share and row["pixels"] == pixels and row["ate_rmse_m"] is not None]
             for share in shares for pixels in ("edges", "random")}
    if not all(means.values()):
        return ""
    better = sum(statistics.mean(means[share, "edges"]) < statistics.mean(means[share, "random"]) for share in shares)
    verdict = ("as the thesis found" if better == len(shares) else
               "against what the thesis found" if better == 0 else "so that neither is the better choice everywhere")
    return prose(f"Edge pixels have the smaller mean ATE at {better} of {len(shares)} shares, {verdict}.")


def ablation_section(sequences):
    chosen = [s for s in sequences if "ablation" in s]
    text = "## Edge pixels against random pixels\n" + prose("""The thesis's figure 5.6, left: a share of the edge
        pixels against as many pixels drawn from the whole image (those with depth that is not behind an occluding
        edge). Adaptive keyframes, each frame's alignment begins at the last pose, no limit on the points; mean
        (least-most) of the runs, each with a seed of its own. *Lost* counts frames of all runs. All of the edges (100
        %) need no draw: their runs are one.""") + "\n![Error against the share of edge pixels](odometry_ablation.png)\n"
    for sequence in chosen:
        rows = []
        all_rows = sequence["ablation"]["rows"]
        for share in sorted({row["share"] for row in all_rows}):
            cells = [f"{share:.0%}"]
            for pixels in ("edges", "random"):
                runs = [row for row in all_rows if row["share"] == share and row["pixels"] == pixels]
                points = [row["points"] for row in runs if row["points"]]
                if pixels == "edges":
                    cells.append(f"{statistics.median(points):.0f}" if points else "-")
                cells += [spread([row["ate_rmse_m"] for row in runs]),
                          spread([row["rpe_rmse_m_per_s"] for row in runs]), sum(row["lost"] for row in runs)]
            rows.append(cells)
        runs = max(row["seed"] for row in all_rows)
        text += (f"\n**{sequence['name']}**, {sequence['ablation']['frames']} frames, {runs} runs:\n\n" +
                 table(["share", "points", "ATE (m), edges", "RPE (m/s), edges", "lost", "ATE (m), random",
                        "RPE (m/s), random", "lost"], rows) + ablation_sentence(all_rows))
    return text


def pixels_section(sequences):
    chosen = [s for s in sequences if "pixels" in s]
    text = "## Time against the number of pixels\n" + prose("""The thesis's figure 5.6, right. Growing shares of the
        edge pixels, then as many pixels from anywhere, up to all that have depth: no limit on the points, other
        parameters the defaults. *Tracked*: median of the frames that were aligned with a keyframe and did not
        become one; *keyframe*: of those that did, with the drawing of random pixels, which the defaults have
        not.""") + "\n![Time against the number of pixels](odometry_pixels.png)\n"
    for sequence in chosen:
        rows = [["edges" if row["pixels"] == "edges" else "anywhere", number(row["points"], 0),
                 number(row["tracked_ms"], 2), number(row["keyframe_ms"], 2), number(row["ate_rmse_m"]), row["lost"]]
                for row in sequence["pixels"]["rows"]]
        fit = vo_plots.line_through(sequence["pixels"]["rows"])
        text += (prose(f"**{sequence['name']}**, {sequence['pixels']['frames']} frames; a line through the tracked times: "
                       f"{fit[1]:.2f} ms + {1000 * fit[0]:.3f} us per pixel of the finest level, all within {fit[2]:.0%}:") + "\n" +
                 table(["pixels", "points of the finest level", "tracked (ms)", "keyframe (ms)", "ATE (m)", "lost"],
                       rows))
    return text


def basin_section(sequences):
    chosen = [s for s in sequences if "basin" in s]
    if not chosen:
        return ""
    bounds = chosen[0]["basin"]
    text = "## Convergence basin\n" + prose(f"""Pairs of neighbouring frames are aligned from guesses that are off
        by a translation or a rotation in random directions, the same for all methods. Converged: the motion found
        is within {1000 * bounds['bound_m']:.0f} mm and {bounds['bound_deg']} deg of the truth. Ours is the
        alignment alone, coarse to fine, without the search that follows when tracking is lost; OpenCV's limits on
        the motion are lifted.""") + "\n![Share that converges against the guess's error](odometry_basin.png)\n"
    for sequence in chosen:
        rows = []
        for row in sequence["basin"]["rows"]:
            off = (f"{1000 * row['translation_m']:.0f} mm" if row["translation_m"] else
                   f"{row['rotation_deg']:.0f} deg" if row["rotation_deg"] else "nothing")
            rows.append([off, *(f"{row[method]:.0%}" for method in ("edge", "rgbd", "rgbd-icp"))])
        text += (f"\n**{sequence['name']}**, {sequence['basin']['pairs']} pairs:\n\n" +
                 table(["guess off by", "LiveMap", "RgbdOdometry", "RgbdICPOdometry"], rows))
    return text


def head_section(results):
    machine = results["machine"]
    load = statistics.median(sequence["tables"]["load"] for sequence in results["sequences"])
    others = "otherwise quiet" if load < 1.4 else f"shared with other work: load average {load:.1f}"
    measured = "; measured on " + " at ".join(word for word in (results["date"], results["version"]) if word)
    text = "# Visual odometry: the benchmark\n" + prose(f"""Made by `./livemap bench vo`; do not edit. [Visual
        odometry](../explanation/odometry.md) explains the method. [Stereo and monocular
        odometry](stereo-and-monocular-odometry.md) has the figures without a depth sensor, and a summary of this
        page; here every sequence has depth. The method was built for the bars below, and all of this page's sequences
        were looked at while that was done. [Rooms that differ](odometry-rooms.md) says how it does elsewhere.""") + prose(
            f"""Machine:
        {machine['cores']} cores, {machine['cpu']}, {others}. All methods run on one thread (`cv::setNumThreads(1)`)
        in one process, beside each other, OpenCV's with their default settings; n is the number of frames{measured}.
        [What the figures mean](../reference/measures.md#evaluate-trajectory): SE(3) alignment, RPE over 1 s, RMSE.""") + """
```
./livemap bench vo                                         # this page
./livemap bench vo --sequence rgbd_dataset_freiburg1_desk  # with a sequence of your own
./livemap bench edge_vo                                    # single frames, Google Benchmark
```
"""
    if results["quick"]:
        text += "\n**A quick run over tiny sequences: its figures show that everything runs, and nothing else.**\n"
    return text


def paths_section(sequences):
    if not vo_plots.with_paths(sequences):
        return ""
    return ("## Paths\n" + prose("The thesis's figure 5.7: truth, LiveMap (canny KF) and RgbdOdometry, moved onto the truth: "
                                "the path in the plane of its two widest axes, and each pose's error.") +
            "\n![Paths and errors over time](odometry_paths.png)\n")


def write(results, out):
    """Writes odometry.md and its plots into the folder `out`; returns the page's path."""
    sequences = results["sequences"]
    out.mkdir(parents=True, exist_ok=True)
    vo_plots.draw_all(sequences, out)
    sections = [head_section(results), bars_section(sequences), sequences_section(sequences, results["missing"]),
                accuracy_section(sequences, results["structured"]), time_section(sequences),
                ablation_section(sequences), pixels_section(sequences), basin_section(sequences),
                paths_section(sequences)]
    page = out / "odometry.md"
    page.write_text("\n".join(section for section in sections if section), encoding="utf-8")
    return page
