"""The tables that livemap bench vo --worlds prints."""

import statistics


def cell(value, digits):
    return "-" if value is None else f"{value:.{digits}f}"


def outcome(row):
    """One row in words, for who waits."""
    return (f"every {row['step']}: ATE {cell(row['ate_rmse_m'], 4)} m, "
            f"{row['lost']} lost of {row['tracked_frames']}")


def median(rows, figure):
    """Of the rows that have the figure; None where no row has it."""
    values = [row[figure] for row in rows if row[figure] is not None]
    return statistics.median(values) if values else None


def summaries(rows):
    """What all rows of a step have in common, a dictionary for each step."""
    found = []
    for step in sorted({row["step"] for row in rows}):
        of_step = [row for row in rows if row["step"] == step]
        found.append({
            "step": step, "rooms": len(of_step), "ate_median_m": median(of_step, "ate_rmse_m"),
            "ate_worst_m": max((row["ate_rmse_m"] for row in of_step if row["ate_rmse_m"] is not None), default=None),
            "lost": sum(row["lost"] for row in of_step), "frames": sum(row["tracked_frames"] for row in of_step),
            "nees_translation_median": median(of_step, "nees_translation"),
            "nees_rotation_median": median(of_step, "nees_rotation")})
    return found


def table(rows):
    """Markdown: a row per world and step, and what all of a step have in common."""
    lines = ["| seed | motion and sensor | every | frames | path (m) | ATE (m) | worst step (m) | lost "
             "| NEES translation | NEES rotation | ms |", "|" + "---|" * 11]
    for row in rows:
        lines.append(f"| {row['seed']} | `{row['flags']}` | {row['step']} | {row['tracked_frames']} "
                     f"| {cell(row['length_m'], 2)} | {cell(row['ate_rmse_m'], 4)} | {cell(row['worst_step_m'], 4)} "
                     f"| {row['lost']} | {cell(row['nees_translation'], 2)} | {cell(row['nees_rotation'], 2)} "
                     f"| {cell(row['median_ms'], 2)} |")
    text = "\n".join(lines) + "\n"
    for summary in summaries(rows):
        text += (f"\nEvery {summary['step']}: median ATE {cell(summary['ate_median_m'], 4)} m, worst "
                 f"{cell(summary['ate_worst_m'], 4)} m, {summary['lost']} frames lost of {summary['frames']}; median NEES "
                 f"{cell(summary['nees_translation_median'], 2)} (translation), "
                 f"{cell(summary['nees_rotation_median'], 2)} (rotation).\n")
    return text


def box_table(rows):
    """Markdown: a row for each kind of walk through rooms of boxes."""
    lines = ["| rooms | seeds | n | median ATE (m) | worst (m) | lost | false | NEES t: median, rooms above 2 | ms |",
             "|" + "---|" * 9]
    for row in rows:
        seeds = f"every 2nd, {row['first_seed']} to {row['each'][-1]['seed']}"
        lines.append(f"| {row['trial']} | {seeds} | {row['rooms']} | {cell(row['median_ate_m'], 5)} "
                     f"| {cell(row['worst_ate_m'], 4)} | {row['lost']} of {row['frames']} | {row['false_rooms']} "
                     f"| {cell(row['median_nees_translation'], 2)}, {row['rooms_above_nees_2']} "
                     f"| {cell(row['median_ms'], 2)} |")
    return "\n".join(lines) + "\n"
