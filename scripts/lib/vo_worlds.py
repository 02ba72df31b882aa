"""The table of generated rooms that livemap bench vo --worlds prints."""

import statistics


def cell(value, digits):
    return "-" if value is None else f"{value:.{digits}f}"


def outcome(row):
    """One row in words, for who waits."""
    return (f"every {row['step']}: ATE {cell(row['ate_rmse_m'], 4)} m, "
            f"{row['lost']} lost of {row['tracked_frames']}")


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
    for step in sorted({row["step"] for row in rows}):
        of_step = [row for row in rows if row["step"] == step]
        errors = [row["ate_rmse_m"] for row in of_step]
        text += (f"\nEvery {step}: median ATE {statistics.median(errors):.4f} m, worst {max(errors):.4f} m, "
                 f"{sum(row['lost'] for row in of_step)} frames lost of {sum(row['tracked_frames'] for row in of_step)}.\n")
    return text
