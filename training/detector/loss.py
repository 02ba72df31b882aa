"""Label assignment and loss.

Assignment: task-aligned (TOOD, Feng et al. 2021, equation 4): an anchor point fits a label as
score^ALPHA * IoU^BETA; the best few per label become positive and learn a score equal to how well
they fit. There is no separate objectness: each class is a binary question, so that a picture whose
data set does not label a class can be left out of that class's loss.
"""

import math
from dataclasses import dataclass, fields
from typing import List, Tuple

import torch
from torch import Tensor
from torch.nn import functional as F

from .network import anchor_points, decode_boxes

ALPHA, BETA = 0.5, 6.0
POSITIVES_PER_LABEL = 10
BOX_WEIGHT, SCORE_WEIGHT = 7.5, 1.0
OTHER_CLASS_WEIGHT = 0.5


@dataclass
class Target:
    """What is known about one training image, in pixels of the network's input."""

    boxes: Tensor  # G x 4 corners
    classes: Tensor  # G, int64
    ignored: Tensor  # K x 4 corners: regions that say nothing about background
    labelled: Tensor  # C: weight of background per class, 0 where the data set does not label the class


@dataclass
class TargetBatch:
    """Targets of B images, filled up to the most labels G and ignored regions K that one of them has.

    Together, so that a loss asks a GPU for a few large operations instead of many small ones per image.
    """

    boxes: Tensor  # B x G x 4, zero where there is no label
    classes: Tensor  # B x G, int64
    present: Tensor  # B x G, bool: is there a label?
    ignored: Tensor  # B x K x 4, zero where there is no region
    labelled: Tensor  # B x C

    @staticmethod
    def of(targets: List[Target]) -> "TargetBatch":
        """At least one column of labels and of regions, so that none of them is a case of its own."""
        most = max(1, *(len(target.boxes) for target in targets))
        most_ignored = max(1, *(len(target.ignored) for target in targets))
        filled = lambda rows, count: F.pad(rows, (0, 0) * (rows.dim() - 1) + (0, count - len(rows)))
        return TargetBatch(
            torch.stack([filled(target.boxes, most) for target in targets]),
            torch.stack([filled(target.classes, most) for target in targets]),
            torch.stack([torch.arange(most) < len(target.boxes) for target in targets]),
            torch.stack([filled(target.ignored, most_ignored) for target in targets]),
            torch.stack([target.labelled for target in targets]),
        )

    def to(self, device: torch.device) -> "TargetBatch":
        """The same on a device."""
        return TargetBatch(*(getattr(self, field.name).to(device) for field in fields(self)))


@dataclass
class Assignment:
    """What each anchor point of B images shall predict."""

    scores: Tensor  # B x N x C in [0, 1]
    boxes: Tensor  # B x N x 4, meaningful where positive
    positive: Tensor  # B x N, bool
    weights: Tensor  # B x N x C in [0, 1]: 0 where the score is not judged


def pairwise_iou(first: Tensor, second: Tensor) -> Tensor:
    """B x N x 4 and B x G x 4 corners to B x N x G intersections over unions."""
    left_top = torch.maximum(first[:, :, None, :2], second[:, None, :, :2])
    right_bottom = torch.minimum(first[:, :, None, 2:], second[:, None, :, 2:])
    intersection = (right_bottom - left_top).clamp(min=0).prod(dim=3)
    area = lambda boxes: (boxes[..., 2:] - boxes[..., :2]).clamp(min=0).prod(dim=2)
    return intersection / (area(first)[:, :, None] + area(second)[:, None] - intersection).clamp(min=1e-9)


def complete_iou(predicted: Tensor, wanted: Tensor) -> Tensor:
    """CIoU (Zheng et al. 2020) of P x 4 box pairs: IoU less centre distance and aspect difference."""
    size_p, size_w = predicted[:, 2:] - predicted[:, :2], wanted[:, 2:] - wanted[:, :2]
    overlap = torch.minimum(predicted[:, 2:], wanted[:, 2:]) - torch.maximum(predicted[:, :2], wanted[:, :2])
    intersection = overlap.clamp(min=0).prod(dim=1)
    iou = intersection / (size_p.prod(dim=1) + size_w.prod(dim=1) - intersection + 1e-7)
    hull = torch.maximum(predicted[:, 2:], wanted[:, 2:]) - torch.minimum(predicted[:, :2], wanted[:, :2])
    centre_offset = (predicted[:, :2] + predicted[:, 2:] - wanted[:, :2] - wanted[:, 2:]) / 2
    distance = centre_offset.square().sum(dim=1) / (hull.square().sum(dim=1) + 1e-7)
    angle = torch.atan(size_w[:, 0] / size_w[:, 1]) - torch.atan(size_p[:, 0] / (size_p[:, 1] + 1e-7))
    aspect = 4 / math.pi**2 * angle.square()
    with torch.no_grad():
        aspect_weight = aspect / (1 - iou + aspect + 1e-7)
    return iou - distance - aspect_weight * aspect


def points_inside(points: Tensor, boxes: Tensor, reach: Tensor) -> Tensor:
    """N x 2 points and B x G x 4 boxes to B x N x G: is a point inside, where a box reaches at least reach[n] from its centre?"""
    centres, half_sizes = (boxes[..., :2] + boxes[..., 2:]) / 2, (boxes[..., 2:] - boxes[..., :2]) / 2
    limits = torch.maximum(half_sizes[:, None], reach[None, :, None, None])
    return ((points[None, :, None] - centres[:, None]).abs() < limits).all(dim=3)


class TaskAlignedLoss:
    """Loss of a batch: CIoU of positive boxes and binary cross-entropy of all scores."""

    def __init__(self, height: int, width: int, device: torch.device):
        self.grid, self.strides = (tensor.to(device) for tensor in anchor_points(height, width))
        self.centres = (self.grid + 0.5) * self.strides[:, None]

    def assign(self, scores: Tensor, boxes: Tensor, targets: TargetBatch) -> Assignment:
        """Labels to anchor points, given the scores (B x N x C) and boxes (B x N x 4) predicted now."""
        weights = targets.labelled[:, None].expand_as(scores)
        ignored = points_inside(self.centres, targets.ignored, 0 * self.strides).any(dim=2)
        weights = weights.masked_fill(ignored[..., None], 0)

        candidates = points_inside(self.centres, targets.boxes, self.strides) & targets.present[:, None]
        iou = pairwise_iou(boxes, targets.boxes)
        score_of_label = scores.gather(2, targets.classes[:, None].expand_as(iou))
        fit = score_of_label.pow(ALPHA) * iou.pow(BETA) * candidates
        best = fit.topk(min(POSITIVES_PER_LABEL, fit.shape[1]), dim=1)
        chosen = torch.zeros_like(candidates).scatter_(1, best.indices, best.values > 0) & candidates

        # An anchor point chosen by several labels serves the one that it overlaps most.
        label_of_point = torch.where(chosen, iou, torch.full_like(iou, -1.0)).argmax(dim=2)
        positive = chosen.any(dim=2)
        class_of_point = targets.classes.gather(1, label_of_point)[..., None]

        # Scores to learn: the fit, scaled per label so that its best point learns that label's best IoU.
        fit = torch.where(chosen, fit, torch.zeros_like(fit))
        scale = (iou * chosen).amax(dim=1) / fit.amax(dim=1).clamp(min=1e-12)
        learnt = (fit * scale[:, None]).gather(2, label_of_point[..., None])
        wanted_scores = torch.zeros_like(scores).scatter_(2, class_of_point, learnt * positive[..., None])
        # An object is of one class: it is background of the others a little, even where these are not labelled.
        of_object = weights.clamp(min=OTHER_CLASS_WEIGHT).scatter(2, class_of_point, 1.0)
        weights = torch.where(positive[..., None], of_object, weights)
        wanted_boxes = targets.boxes.gather(1, label_of_point[..., None].expand_as(boxes))
        return Assignment(wanted_scores, wanted_boxes, positive, weights)

    def __call__(self, raw: Tensor, targets: TargetBatch) -> Tuple[Tensor, Tensor]:
        """Raw predictions (B x N x (4 + C)) and targets to (box loss, score loss), weighted."""
        raw = raw.float()
        boxes, logits = decode_boxes(raw[..., :4], self.grid, self.strides), raw[..., 4:]
        with torch.no_grad():
            wanted = self.assign(logits.sigmoid(), boxes, targets)
        normaliser = wanted.scores.sum().clamp(min=1.0)
        score_loss = (F.binary_cross_entropy_with_logits(logits, wanted.scores, reduction="none") * wanted.weights).sum()

        importance = wanted.scores[wanted.positive].sum(dim=1)
        overlap = complete_iou(boxes[wanted.positive], wanted.boxes[wanted.positive])
        box_loss = ((1 - overlap) * importance).sum()
        return BOX_WEIGHT * box_loss / normaliser, SCORE_WEIGHT * score_loss / normaliser
