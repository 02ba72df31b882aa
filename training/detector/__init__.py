"""Training and evaluation of LiveMap's hazard detector."""

CLASSES = ("pothole", "traffic_cone")
"""Class names in the order of the network's outputs."""
