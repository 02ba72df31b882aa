"""Figures for people: what nothing was measured for is told as such, never as 0."""

from typing import Iterable, Optional


class NothingMeasured(Exception):
    """An evaluation whose data are sound but give no figure; the text is one sentence, and the exit status 1."""


def text(value: Optional[float], digits: int = 3) -> str:
    """A figure with so many digits; "none" where it is not defined."""
    return "none" if value is None else f"{value:.{digits}f}"


def mean(values: Iterable[Optional[float]]) -> Optional[float]:
    """The mean of those that are defined; None where none is."""
    defined = [value for value in values if value is not None]
    return sum(defined) / len(defined) if defined else None


def share(part: float, whole: float) -> Optional[float]:
    """Their ratio; None where nothing was counted."""
    return float(part) / float(whole) if whole > 0 else None
