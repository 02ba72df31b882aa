"""What the classifier learns from a batch: where hazards are, and whether there is one."""

from typing import List, Tuple

import torch
from torch import Tensor
from torch.nn import functional as F

from detector.loss import Target

from .labels import FAR, REPORTABLE
from .network import STRIDE

FOCUS = 1.5
"""Exponent of the focal loss: cells that are right already count little."""

CALM, HAZARD, UNKNOWN = 0.0, 1.0, -1.0


def paint(cells: Tensor, boxes: Tensor, value: float, margin: float) -> None:
    """Set the cells whose centre lies within a box grown by `margin` cells, and always the one of its own centre."""
    rows, columns = cells.shape
    for box in (boxes / STRIDE).tolist():
        centre_x, centre_y = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
        left, right = round(min(box[0] - margin, centre_x - 0.5)), round(max(box[2] + margin, centre_x + 0.5))
        top, bottom = round(min(box[1] - margin, centre_y - 0.5)), round(max(box[3] + margin, centre_y + 0.5))
        cells[max(top, 0) : min(bottom, rows), max(left, 0) : min(right, columns)] = value


def cell_targets(targets: List[Target], rows: int, columns: int) -> Tensor:
    """B x rows x columns of CALM, HAZARD or UNKNOWN: rims of boxes, far hazards and labels that a view cuts."""
    cells = torch.full((len(targets), rows, columns), CALM)
    for own, target in zip(cells, targets):
        near = target.boxes[target.classes == REPORTABLE].cpu()
        for boxes in (near, target.boxes[target.classes == FAR].cpu(), target.ignored.cpu()):
            paint(own, boxes, UNKNOWN, 1.0)
        paint(own, near, HAZARD, 0.0)
    return cells


def losses(logits: Tensor, targets: List[Target]) -> Tuple[Tensor, Tensor]:
    """Mean loss of the cells (per hazard cell) and of the frames.

    Calm cells count as much as the target's background does. A frame with a reportable box is judged by the cells of such
    boxes, one without by its known cells.
    """
    logits = logits.float()[:, 0]
    cells = cell_targets(targets, *logits.shape[1:]).to(logits.device)
    known = cells != UNKNOWN
    wanted = cells.clamp(min=0)
    plain = F.binary_cross_entropy_with_logits(logits, wanted, reduction="none")
    wrongness = (logits.sigmoid() - wanted).abs()
    calm_weights = torch.stack([target.labelled.min() for target in targets]).to(logits.device)
    weights = torch.where(wanted > 0, wanted, known * calm_weights[:, None, None])
    of_cells = (plain * wrongness.detach() ** FOCUS * weights).sum() / wanted.sum().clamp(min=8.0)
    hazardous = wanted.flatten(1).max(dim=1).values
    judged = torch.where(hazardous[:, None, None] > 0, cells == HAZARD, known)
    highest = logits.masked_fill(~judged, -30.0).flatten(1).max(dim=1).values
    frame_weights = torch.where(hazardous > 0, hazardous, calm_weights)
    of_frames = F.binary_cross_entropy_with_logits(highest, hazardous, reduction="none") * frame_weights
    return of_cells, of_frames.sum() / frame_weights.sum().clamp(min=1.0)
