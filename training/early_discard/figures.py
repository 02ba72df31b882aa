"""What a classifier's scores are worth: recall of frames and of events, precision, share of frames that are sent."""

from dataclasses import dataclass
from typing import Dict, List, Optional

import numpy as np

from detector.data import DriveFrame
from detector.metrics import runs_of

from .labels import holds_hazard
from .photos import LabelledPhoto


@dataclass
class ScoredDrive:
    """The frames of one drive in their order."""

    scores: np.ndarray  # N, 0..1
    hazards: np.ndarray  # N, bool: worth sending
    chainage_m: np.ndarray  # N


def score_drive(frames: List[DriveFrame], score) -> ScoredDrive:
    """Scores of a drive's frames by `score(image)`."""
    return ScoredDrive(
        np.array([score(frame.picture.image) for frame in frames]),
        np.array([holds_hazard(frame.picture) for frame in frames]),
        np.array([frame.chainage_m for frame in frames]),
    )


@dataclass
class ScoredPhoto:
    """One photo of a set that labels some classes."""

    score: float
    classes: List[str]  # of its reportable boxes
    is_empty: bool  # no box at all


def score_photos(photos: List[LabelledPhoto], score) -> List[ScoredPhoto]:
    """Scores of photos by `score(image)`."""
    return [ScoredPhoto(score(photo.picture.image), photo.classes, not len(photo.picture.boxes)) for photo in photos]


def as_drive(photos: List[ScoredPhoto]) -> ScoredDrive:
    """Photos as frames that lie far apart; those with far boxes alone are left out."""
    counted = [photo for photo in photos if photo.classes or photo.is_empty]
    return ScoredDrive(
        np.array([photo.score for photo in counted]), np.array([bool(photo.classes) for photo in counted], bool),
        1000.0 * np.arange(len(counted)),
    )


def by_class(photos: Dict[str, List[ScoredPhoto]]) -> Dict[str, ScoredDrive]:
    """Photos with a reportable box, by its class."""
    every = [photo for group in photos.values() for photo in group]
    names = sorted({name for photo in every for name in photo.classes})
    return {name: as_drive([photo for photo in every if name in photo.classes]) for name in names}


def event_scores(drive: ScoredDrive) -> List[float]:
    """Per event (a run of frames with hazards at most NEAR_M apart) the best score of its frames."""
    return [float(drive.scores[run].max()) for run in runs_of(drive.hazards, drive.chainage_m)]


def threshold_for_recall(drives: Dict[str, ScoredDrive], recall: float) -> float:
    """The highest threshold, in thousandths, that sends at least `recall` of the frames with hazards (there are some); at least 0.001."""
    scores = np.sort(np.concatenate([drive.scores[drive.hazards] for drive in drives.values()]))
    lowest = scores[int(np.floor((1 - recall) * len(scores) + 1e-9))]
    return float(np.clip(np.floor(lowest * 1000) / 1000, 0.001, 0.999))


@dataclass
class Figures:
    """At one threshold, over all drives."""

    frames: int
    hazard_frames: int
    recall: Optional[float]  # None without hazards.
    precision: Optional[float]  # None where nothing is sent.
    share_sent: Optional[float]  # None without frames.
    events: int
    event_recall: Optional[float]  # None without events.
    ranking: Optional[float]  # Probability that a frame with a hazard scores above one without (AUC); None without both kinds.


def figures(drives: Dict[str, ScoredDrive], threshold: float) -> Figures:
    """Figures at a threshold."""
    scores = np.concatenate([np.zeros(0), *(drive.scores for drive in drives.values())])
    hazards = np.concatenate([np.zeros(0, bool), *(drive.hazards for drive in drives.values())])
    events = np.array([score for drive in drives.values() for score in event_scores(drive)])
    sent = scores >= threshold
    calm, worth = scores[~hazards], scores[hazards]
    above = (worth[:, None] > calm[None]).mean() + 0.5 * (worth[:, None] == calm[None]).mean() if len(calm) and len(worth) else None
    return Figures(
        len(scores), int(hazards.sum()), float(sent[hazards].mean()) if hazards.any() else None,
        float(hazards[sent].mean()) if sent.any() else None, float(sent.mean()) if len(sent) else None, len(events),
        float((events >= threshold).mean()) if len(events) else None, None if above is None else float(above),
    )
