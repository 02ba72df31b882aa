"""The thesis's figures (tables 4.1 and 4.2): pooled over the pixels of all pairs."""

from typing import Dict, Optional

import numpy as np

from common.figures import share

from .classes import CLASSES, NO_CHANGE
from .data import IGNORED

HIGHEST_LOG_ODDS = 24.0
BINS = 9600


class PixelCounts:
    """Counts of pixels by truth and by score (1 - probability of no change), and by class where the best class is taken."""

    def __init__(self):
        self.scores = np.zeros((2, BINS), np.int64)  # unchanged, changed
        self.confusion = np.zeros((len(CLASSES), len(CLASSES)), np.int64)  # truth, found

    def add(self, probabilities: np.ndarray, mask: np.ndarray) -> None:
        """One pair: C x H x W and H x W; ignored pixels are left out."""
        known = mask != IGNORED
        truth = mask[known]
        changed = probabilities[NO_CHANGE + 1 :].sum(axis=0)[known].astype(np.float64)
        unchanged = probabilities[NO_CHANGE][known].astype(np.float64)
        log_odds = np.log(np.maximum(changed, 1e-12)) - np.log(np.maximum(unchanged, 1e-12))
        bins = ((log_odds / HIGHEST_LOG_ODDS + 1) / 2 * BINS).astype(np.int64).clip(0, BINS - 1)
        for row, of in enumerate((truth == NO_CHANGE, truth != NO_CHANGE)):
            self.scores[row] += np.bincount(bins[of], minlength=BINS)
        found = probabilities.argmax(axis=0)[known]
        pairs = np.bincount(truth.astype(np.int64) * len(CLASSES) + found, minlength=len(CLASSES) ** 2)
        self.confusion += pairs.reshape(len(CLASSES), len(CLASSES))

    def at_false_positive_rate(self, rate: float) -> Dict[str, Optional[float]]:
        """Precision, recall and F1 at the lowest threshold whose false positive rate is not above `rate`; None: nothing was counted."""
        unchanged, changed = np.cumsum(self.scores[:, ::-1], axis=1)
        allowed = np.nonzero(unchanged <= rate * max(unchanged[-1], 1))[0]
        false, true = (int(counts[allowed[-1]]) if len(allowed) else 0 for counts in (unchanged, changed))
        missed = int(changed[-1]) - true
        return {
            "precision": share(true, true + false), "recall": share(true, true + missed), "f1": share(2 * true, 2 * true + false + missed),
            "threshold": self.threshold_of(allowed[-1]) if len(allowed) else 1.0,
        }

    @staticmethod
    def threshold_of(bins_from_above: int) -> float:
        """The score at the lower edge of a bin, counted from the highest."""
        log_odds = (2 * (BINS - 1 - bins_from_above) / BINS - 1) * HIGHEST_LOG_ODDS
        return float(1 / (1 + np.exp(-log_odds)))

    def best_class_figures(self) -> Dict[str, Optional[float]]:
        """Where each pixel takes its most probable class; multi_class is over changed pixels that are found changed. None: nothing was counted."""
        table = self.confusion.astype(float)
        hits = table[1:, 1:]
        true, found, there, total = hits.sum(), table[:, 1:].sum(), table[1:].sum(), table.sum()
        return {
            "binary_accuracy": share(true + table[0, 0], total), "precision": share(true, found), "recall": share(true, there),
            "f1": share(2 * true, found + there), "multi_class": share(np.trace(hits), true),
            "false_positive_rate": share(table[0, 1:].sum(), table[0].sum()), "changed_share": share(there, total),
        }
