"""The ten classes of change, in one place for Python; the simulator's are src/simulation/change.cpp's (a test compares)."""

CLASSES = (
    "no_change", "barrier", "bin", "construction", "other_objects", "person_cycle", "rubbish", "sign", "traffic_cone", "vehicle",
)
"""Names in the order of the network's outputs and of the values in a mask. Those of VL-CMU-CD without `misc`."""

NO_CHANGE = 0
