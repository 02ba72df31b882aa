"""The ten classes of change, in one place for Python; C++ has them with its ChangeClass (a test compares)."""

CLASSES = (
    "no_change", "barrier", "bin", "construction", "other_objects", "person_cycle", "rubbish", "sign", "traffic_cone", "vehicle",
)
"""Names in the order of the network's outputs and of the values in a mask. Those of VL-CMU-CD without `misc`."""

NO_CHANGE = 0

COLOURS = (
    (255, 255, 255), (136, 0, 21), (237, 28, 36), (255, 127, 39), (34, 177, 76), (0, 162, 232), (63, 72, 204), (163, 73, 164),
    (255, 174, 201), (181, 230, 29),
)
"""RGB of the classes in the published ground truth; any other colour but the next is ignored."""

MISCELLANEOUS = (255, 242, 0)
"""A colour for a class that the thesis (section 4.4.1) counts as rubbish."""
