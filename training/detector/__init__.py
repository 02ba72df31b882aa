"""Training and evaluation of LiveMap's hazard detector."""

CLASSES = (
    "pothole", "traffic_cone", "road_work_sign", "barrier", "debris", "deer", "construction_machine", "stopped_accident",
)
"""Class names in the order of the network's outputs; those that a user adds come after them."""
