"""A tiny data set in the layouts of the real ones, generated: grey road, dark ellipses, orange triangles."""

from pathlib import Path

import cv2
import numpy as np

TRAINING_SECTION, VALIDATION_SECTION = "999TEST", "386RS169832"


def write_picture(folder: Path, stem: str, seed: int, cone: bool = False, empty: bool = False) -> None:
    """One 640x400 image with one object in the middle, and its label."""
    rng = np.random.default_rng(seed)
    image = rng.normal(120, 6, (400, 640, 3)).clip(0, 255).astype(np.uint8)
    x, y, width, height = 320 + int(rng.integers(-60, 60)), 200, 60, 40
    label = ""
    if not empty:
        if cone:
            corners = np.array([[x, y - height // 2], [x - width // 2, y + height // 2], [x + width // 2, y + height // 2]])
            cv2.fillPoly(image, [corners], (0, 100, 255))
        else:
            cv2.ellipse(image, (x, y), (width // 2, height // 2), 0, 0, 360, (40, 40, 40), -1)
        label = f"0 {x / 640} {y / 400} {width / 640} {height / 400}\n"
    image_path, label_path = folder / "images" / f"{stem}.jpg", folder / "labels" / f"{stem}.txt"
    for path in (image_path, label_path):
        path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(image_path), image)
    label_path.write_text(label)


def write_simulated(root: Path) -> Path:
    """A folder of one simulated drive whose classes are in another order than ours, one of them unknown; returns it."""
    write_picture(root / "000001", "000000", 50, cone=True)
    (root / "000001" / "classes.txt").write_text("traffic_cone\nunicorn\npothole\n")
    label_path = root / "000001" / "labels" / "000000.txt"
    label_path.write_text(label_path.read_text() + "1 0.2 0.2 0.1 0.1\n2 0.8 0.7 0.1 0.1\n")
    return root


def write_own(root: Path) -> Path:
    """A user's own pictures of potholes and a sinkhole, a class that LiveMap does not have; returns it."""
    for index, label in enumerate(("1 0.5 0.5 0.1 0.1", "0 0.5 0.5 0.2 0.2")):
        write_picture(root, f"own{index}", 60 + index)
        (root / "labels" / f"own{index}.txt").write_text(f"{label}\n1 0.2 0.8 0.1 0.1\n")
    (root / "classes.txt").write_text("sinkhole\npothole\n")
    return root


SETS = """\
rename: {animal_other: deer}
signs: {folder: signs, kind: road_work, class: road_work_sign}
sets:
  cattle:
    folder: cattle
    labelled: [deer]
    absent: [pothole]
    held_out: ["street2-*"]
    background: true
  holes:
    folder: holes
    classes: [pothole]
    labelled: [pothole]
    held_out: {blocks: 1}
    skip: [blank]
"""


def write_sets(root: Path) -> Path:
    """Two sets of photos and crops of signs below `root`; returns the file that lists the sets."""
    for seed, name in enumerate(("street1-2", "street1-10", "street2-1", "street2-10")):
        write_picture(root / "cattle", name, 70 + seed)
    (root / "cattle" / "classes.txt").write_text("animal_other\ntraffic_cone\n")
    for seed, name in enumerate(("n1", "n2", "n10", "n11", "n12", "n20", "blank")):
        write_picture(root / "holes", name, 80 + seed)
    for kind in ("road_work", "stop"):
        for number in range(2):
            crop = np.full((60, 60, 3), (40, 60, 230), np.uint8)
            (root / "signs" / kind).mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(root / "signs" / kind / f"{number}.png"), crop)
    (root / "sets.yaml").write_text(SETS)
    return root / "sets.yaml"


def write_data(root: Path) -> Path:
    """A whole data folder; returns it."""
    for number, section in enumerate((TRAINING_SECTION, VALIDATION_SECTION)):
        folder = root / "road_survey" / section
        for index in range(4):
            write_picture(folder, f"frame{index}", 10 * number + index, empty=index == 3)
        rows = [f"frame{index},{100 + 5 * index},{int(index != 3)}" for index in range(4)]
        (folder / "frames.csv").write_text("\n".join(["frame,chainage_m,potholes"] + rows) + "\n")
    write_picture(root / "pothole_closeups", "0000", 30)
    for split in ("train", "val"):
        folder = root / "traffic_cones"
        write_picture(folder / split, "cone", 40, cone=True)
        for kind in ("images", "labels"):
            (folder / kind).mkdir(parents=True, exist_ok=True)
            (folder / split / kind).rename(folder / kind / split)
    return root
