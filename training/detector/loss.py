"""Label assignment and loss.

Assignment: task-aligned (TOOD, Feng et al. 2021, equation 4): an anchor point fits a label as
score^ALPHA * IoU^BETA; the best few per label become positive and learn a score equal to how well
they fit. There is no separate objectness: each class is a binary question, so that a picture whose
data set does not label a class can be left out of that class's loss.
"""

import math
from dataclasses import dataclass
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
class Assignment:
    """What each anchor point of one image shall predict."""

    scores: Tensor  # N x C in [0, 1]
    boxes: Tensor  # P x 4, one row per positive anchor point
    positive: Tensor  # N, bool
    weights: Tensor  # N x C in [0, 1]: 0 where the score is not judged


def pairwise_iou(first: Tensor, second: Tensor) -> Tensor:
    """N x 4 and M x 4 corners to N x M intersections over unions."""
    left_top = torch.maximum(first[:, None, :2], second[None, :, :2])
    right_bottom = torch.minimum(first[:, None, 2:], second[None, :, 2:])
    intersection = (right_bottom - left_top).clamp(min=0).prod(dim=2)
    area = lambda boxes: (boxes[:, 2:] - boxes[:, :2]).clamp(min=0).prod(dim=1)
    return intersection / (area(first)[:, None] + area(second)[None] - intersection).clamp(min=1e-9)


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
    """N x G: is point n inside box g, where a box reaches at least reach[n] from its centre?"""
    centres, half_sizes = (boxes[:, :2] + boxes[:, 2:]) / 2, (boxes[:, 2:] - boxes[:, :2]) / 2
    limits = torch.maximum(half_sizes[None], reach[:, None, None])
    return ((points[:, None] - centres[None]).abs() < limits).all(dim=2)


class TaskAlignedLoss:
    """Loss of a batch: CIoU of positive boxes and binary cross-entropy of all scores."""

    def __init__(self, height: int, width: int, device: torch.device):
        self.grid, self.strides = (tensor.to(device) for tensor in anchor_points(height, width))
        self.centres = (self.grid + 0.5) * self.strides[:, None]

    def assign(self, scores: Tensor, boxes: Tensor, target: Target) -> Assignment:
        """Labels of one image to anchor points, given the scores (N x C) and boxes (N x 4) predicted now."""
        wanted_scores = torch.zeros_like(scores)
        weights = target.labelled.expand_as(scores).clone()
        weights[points_inside(self.centres, target.ignored, 0 * self.strides).any(dim=1)] = 0
        positive = torch.zeros(len(scores), dtype=torch.bool, device=scores.device)
        if not len(target.boxes):
            return Assignment(wanted_scores, boxes[:0], positive, weights)

        candidates = points_inside(self.centres, target.boxes, self.strides)
        iou = pairwise_iou(boxes, target.boxes)
        fit = scores[:, target.classes].pow(ALPHA) * iou.pow(BETA) * candidates
        best = fit.topk(min(POSITIVES_PER_LABEL, len(fit)), dim=0)
        chosen = torch.zeros_like(candidates).scatter_(0, best.indices, best.values > 0) & candidates

        # An anchor point chosen by several labels serves the one that it overlaps most.
        label_of_point = torch.where(chosen, iou, torch.full_like(iou, -1.0)).argmax(dim=1)
        positive = chosen.any(dim=1)
        points = positive.nonzero()[:, 0]
        labels = label_of_point[points]

        # Scores to learn: the fit, scaled per label so that its best point learns that label's best IoU.
        fit = torch.where(chosen, fit, torch.zeros_like(fit))
        scale = (iou * chosen).amax(dim=0) / fit.amax(dim=0).clamp(min=1e-12)
        classes = target.classes[labels]
        wanted_scores[points, classes] = (fit * scale)[points, labels]
        # An object is of one class: it is background of the others a little, even where these are not labelled.
        weights[points] = weights[points].clamp(min=OTHER_CLASS_WEIGHT)
        weights[points, classes] = 1
        return Assignment(wanted_scores, target.boxes[labels], positive, weights)

    def __call__(self, raw: Tensor, targets: List[Target]) -> Tuple[Tensor, Tensor]:
        """Raw predictions (B x N x (4 + C)) and targets to (box loss, score loss), weighted."""
        raw = raw.float()
        boxes, logits = decode_boxes(raw[..., :4], self.grid, self.strides), raw[..., 4:]
        with torch.no_grad():
            assignments = [self.assign(s.sigmoid(), b, t) for s, b, t in zip(logits, boxes, targets)]
        wanted = torch.stack([assignment.scores for assignment in assignments])
        weights = torch.stack([assignment.weights for assignment in assignments])
        normaliser = wanted.sum().clamp(min=1.0)
        score_loss = (F.binary_cross_entropy_with_logits(logits, wanted, reduction="none") * weights).sum()

        positive = torch.stack([assignment.positive for assignment in assignments])
        importance = wanted[positive].sum(dim=1)
        overlap = complete_iou(boxes[positive], torch.cat([assignment.boxes for assignment in assignments]))
        box_loss = ((1 - overlap) * importance).sum()
        return BOX_WEIGHT * box_loss / normaliser, SCORE_WEIGHT * score_loss / normaliser
