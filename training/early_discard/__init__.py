"""Training of the small vehicle's send / don't-send classifier."""

INPUT_WIDTH, INPUT_HEIGHT = 320, 208
"""Pixels of the network's input: a 640x400 picture shrinks to half, and 8 rows are padding (the network halves four times)."""

MAX_RANGE_M = 30.0
"""A hazard whose foot lies further away is not reported (max_range_m of hazard_reporting): it is no reason to send."""
