"""Detection figures: average precision, event recall and false reports along a drive.

The same definitions as `livemap evaluate detection`, by which the figures of the model cards are measured; here they
choose weights and thresholds while a network is trained, where no exported model exists and no tree is built. All boxes are N x 4 corners in pixels; detections
are N x 5, corners and score.
"""

from dataclasses import dataclass, field
from typing import Dict, List, Optional, Sequence

import numpy as np

from common.figures import share

from .boxes import areas, pairwise_iou

NEAR_M = 12.0
"""Labelled frames at most this far apart belong to one event, false detections to one false report."""

SHARE_IN_DIFFICULT = 0.5
"""Of a detection's area, from which on it is about a difficult object."""


@dataclass
class ScoredFrame:
    """Labels and detections of one class in one frame."""

    labels: np.ndarray  # N x 4
    detections: np.ndarray  # M x 5
    chainage_m: float = 0.0
    difficult: np.ndarray = field(default_factory=lambda: np.zeros((0, 4)))  # K x 4: neither to be found nor wrong

    def about_difficult(self) -> np.ndarray:
        """Which detections lie at least half in a difficult box: those are not wrong."""
        if not len(self.difficult) or not len(self.detections):
            return np.zeros(len(self.detections), bool)
        boxes = self.detections[:, None, :4]
        sides = np.minimum(boxes[..., 2:], self.difficult[None, :, 2:]) - np.maximum(boxes[..., :2], self.difficult[None, :, :2])
        covered = sides.clip(min=0).prod(axis=2)
        return (covered >= SHARE_IN_DIFFICULT * areas(self.detections[:, :4])[:, None]).any(axis=1)


Drive = Sequence[ScoredFrame]
"""Frames in the order of their chainage."""


def average_precision(frames: Sequence[ScoredFrame], iou: float) -> Optional[float]:
    """Area under the precision envelope over all recalls (all-point interpolation); None without labels.

    Detections are matched greedily from the best score down; a label is matched once.
    """
    label_count = sum(len(frame.labels) for frame in frames)
    scores, hits = [], []
    for frame in frames:
        free = np.ones(len(frame.labels), bool)
        order = np.argsort(-frame.detections[:, 4], kind="stable")
        overlaps = pairwise_iou(frame.detections[order, :4], frame.labels)
        excused = frame.about_difficult()[order]
        for score, overlap, is_excused in zip(frame.detections[order, 4], overlaps, excused):
            overlap = np.where(free, overlap, -1.0)
            best = int(overlap.argmax()) if len(overlap) else -1
            hit = best >= 0 and overlap[best] >= iou
            if hit:
                free[best] = False
            elif is_excused:
                continue
            scores.append(score)
            hits.append(hit)
    if not label_count:
        return None
    if not scores:
        return 0.0
    hits = np.array(hits)[np.argsort(-np.array(scores), kind="stable")]
    true_positives = np.cumsum(hits)
    precision = true_positives / np.arange(1, len(hits) + 1)
    envelope = np.maximum.accumulate(precision[::-1])[::-1]
    return float(envelope[hits].sum() / label_count)


def driven_km(drive: Drive) -> float:
    """Road that the frames cover: gaps between neighbours, of which one over NEAR_M counts NEAR_M."""
    return float(np.minimum(np.diff([frame.chainage_m for frame in drive]), NEAR_M).sum() / 1000)


def runs_of(marked: Sequence[bool], chainage_m: Sequence[float]) -> List[List[int]]:
    """Maximal runs of marked frames whose neighbours are at most NEAR_M apart: the indices of each run's frames."""
    runs: List[List[int]] = []
    for index in np.flatnonzero(marked):
        if runs and chainage_m[index] - chainage_m[runs[-1][-1]] <= NEAR_M:
            runs[-1].append(int(index))
        else:
            runs.append([int(index)])
    return runs


def events(drive: Drive) -> List[List[ScoredFrame]]:
    """Runs of labelled frames."""
    runs = runs_of([len(frame.labels) > 0 for frame in drive], [frame.chainage_m for frame in drive])
    return [[drive[index] for index in run] for run in runs]


def recall_score(event: List[ScoredFrame], iou: float) -> float:
    """The best score that overlaps a label of the event: it is recalled at thresholds up to this."""
    best = -1.0
    for frame in event:
        overlaps = pairwise_iou(frame.detections[:, :4], frame.labels)
        matching = frame.detections[(overlaps >= iou).any(axis=1), 4]
        best = max(best, matching.max(initial=-1.0))
    return best


def highest_false_scores(drive: Drive, iou: float) -> np.ndarray:
    """Per frame, the best score of a detection that overlaps no label; -1 where there is none."""
    return np.array([false_scores(frame, iou).max(initial=-1.0) for frame in drive])


def find_false(frame: ScoredFrame, iou: float) -> np.ndarray:
    """Which detections overlap no label."""
    overlaps = pairwise_iou(frame.detections[:, :4], frame.labels)
    return ~(overlaps >= iou).any(axis=1) & ~frame.about_difficult()


def false_scores(frame: ScoredFrame, iou: float) -> np.ndarray:
    """Scores of the detections that overlap no label."""
    return frame.detections[find_false(frame, iou), 4]


def false_reports(drive: Drive, highest_false: np.ndarray, threshold: float) -> int:
    """Reports that false detections cause: one per NEAR_M of road, as the vehicle would merge them."""
    count, last_began_m = 0, -np.inf
    for frame, score in zip(drive, highest_false):
        if score >= threshold and frame.chainage_m - last_began_m > NEAR_M:
            count, last_began_m = count + 1, frame.chainage_m
    return count


@dataclass
class DriveFigures:
    """Figures of all drives together at one threshold; None: no event, or no driven road."""

    threshold: float
    event_count: int
    event_recall: Optional[float]
    event_recall_iou30: Optional[float]
    km: float
    false_reports_per_km: Optional[float]
    false_detections_per_km: Optional[float]


def drive_figures(drives: Dict[str, Drive], threshold: float) -> DriveFigures:
    """Event recall and false reports at a threshold. False means IoU below 0.5 with every label."""
    km = sum(driven_km(drive) for drive in drives.values())
    runs = [run for drive in drives.values() for run in events(drive)]
    recall = lambda iou: float(np.mean([recall_score(run, iou) >= threshold for run in runs])) if runs else None
    reports = sum(false_reports(drive, highest_false_scores(drive, 0.5), threshold) for drive in drives.values())
    detections = sum((false_scores(frame, 0.5) >= threshold).sum() for drive in drives.values() for frame in drive)
    return DriveFigures(threshold, len(runs), recall(0.5), recall(0.3), km, share(reports, km), share(detections, km))


def calibrate_threshold(drives: Dict[str, Drive], reports_per_km: float) -> float:
    """The lowest threshold, in hundredths, from which on upwards false reports stay within the limit."""
    most_reports = reports_per_km * sum(driven_km(drive) for drive in drives.values())
    false_by_drive = [(drive, highest_false_scores(drive, 0.5)) for drive in drives.values()]
    threshold = 1.0
    while threshold > 0.05:
        lower = round(threshold - 0.01, 2)
        if sum(false_reports(drive, scores, lower) for drive, scores in false_by_drive) > most_reports:
            break
        threshold = lower
    return threshold


def best_f1_threshold(frames: Sequence[ScoredFrame], iou: float) -> float:
    """The threshold, in hundredths, with the best harmonic mean of precision and recall."""
    return max((round(0.01 * step, 2) for step in range(5, 100)), key=lambda limit: f1_score(frames, limit, iou) or 0.0)


def f1_score(frames: Sequence[ScoredFrame], threshold: float, iou: float) -> Optional[float]:
    """Harmonic mean of precision and recall of the detections at a threshold; None without labels and detections."""
    true_positives = detection_count = 0
    for frame in frames:
        detections = frame.detections[frame.detections[:, 4] >= threshold]
        overlaps = pairwise_iou(detections[:, :4], frame.labels)
        true_positives += min((overlaps >= iou).any(axis=1).sum(), (overlaps >= iou).any(axis=0).sum())
        detection_count += (overlaps >= iou).any(axis=1).sum() + (false_scores(frame, iou) >= threshold).sum()
    label_count = sum(len(frame.labels) for frame in frames)
    return share(2 * true_positives, detection_count + label_count)
