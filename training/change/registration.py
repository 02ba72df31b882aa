"""Homographies between the pictures of a pair: from their edges or SIFT matches as the vehicle finds them, or from known poses."""

from typing import Optional, Sequence, Tuple

import cv2
import numpy as np

FEATURES = 1500
RATIO = 0.75
"""Best match's distance over the second best's (Lowe's ratio test)."""

REPROJECTION_PX = 3.0
LEAST_INLIERS = 15
LEAST_OVERLAP = 0.5
"""Of the picture that the warp has to fill."""

EDGE_COLUMNS, FINE_COLUMNS = 80, 160
"""Cells into which a picture's edges are gathered, as src/change/edge_correlation.h has them."""

WORKING_WIDTH = 320
BLOCK_CELLS, PARALLAX_CELLS = 32, 5
MOST_SHIFT_X, MOST_SHIFT_Y = 0.2, 0.15
"""Share of the width and the height."""

MOST_SCALE, SCALES = 1.3, 9
LEAD_CELLS = 3
LEAST_EVIDENCE = 0.82
"""Of correlation, lead and agreement in detail together."""


Features = Tuple[Sequence[cv2.KeyPoint], Optional[np.ndarray]]
"""Keypoints and descriptors of a picture."""


def overlap(homography: np.ndarray, width: int, height: int) -> float:
    """Share of a picture that its partner, warped by the homography, fills."""
    ones = np.full((height, width), 255, np.uint8)
    return float(cv2.warpPerspective(ones, homography, (width, height), flags=cv2.INTER_NEAREST).mean() / 255)


def by_features(first: np.ndarray, second: np.ndarray) -> Optional[np.ndarray]:
    """3 x 3 that takes pixels of the first picture (H x W x 3 uint8) to the second; None where they do not match."""
    sift = cv2.SIFT_create(FEATURES, contrastThreshold=0.02)
    homography, _ = match(*(sift.detectAndCompute(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), None) for image in (first, second)))
    height, width = second.shape[:2]
    return homography if homography is not None and overlap(homography, width, height) >= LEAST_OVERLAP else None


def match(first: Features, second: Features) -> Tuple[Optional[np.ndarray], int]:
    """The homography that most matches of two pictures' features agree on, from the first to the second, and how many; None: too few."""
    if any(descriptors is None or len(descriptors) < LEAST_INLIERS for _, descriptors in (first, second)):
        return None, 0
    matches = cv2.BFMatcher().knnMatch(first[1], second[1], k=2)
    good = [pair[0] for pair in matches if len(pair) == 2 and pair[0].distance < RATIO * pair[1].distance]
    if len(good) < LEAST_INLIERS:
        return None, 0
    points = [np.float32([keypoints[index].pt for index in indices]) for keypoints, indices in (
        (first[0], [match.queryIdx for match in good]), (second[0], [match.trainIdx for match in good]),
    )]
    cv2.setRNGSeed(1)
    homography, inliers = cv2.findHomography(points[0], points[1], cv2.RANSAC, REPROJECTION_PX, maxIters=1000)
    if homography is None or inliers.sum() < LEAST_INLIERS:
        return None, 0
    return homography, int(inliers.sum())


def edge_cells(image: np.ndarray, columns: int = EDGE_COLUMNS) -> np.ndarray:
    """H x W x 3 uint8 to h x columns x 4 float32: strength of the edges by orientation, each against the edges around it."""
    height, width = image.shape[:2]
    rows, cell_px = round(columns * height / width), WORKING_WIDTH // columns
    size = WORKING_WIDTH, rows * cell_px
    grey = cv2.resize(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), size, interpolation=cv2.INTER_AREA if width > size[0] else cv2.INTER_LINEAR)
    smooth = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), 0.8)
    x, y = cv2.Sobel(smooth, cv2.CV_32F, 1, 0), cv2.Sobel(smooth, cv2.CV_32F, 0, 1)
    magnitude = cv2.magnitude(x, y)
    around = magnitude * magnitude
    for _ in range(3):  # nearly a Gaussian's window
        around = cv2.blur(around, (17, 17))
    strength = magnitude / (np.sqrt(np.maximum(around, 0)) + 20)
    x, y = x / np.maximum(magnitude, 1e-6), y / np.maximum(magnitude, 1e-6)
    cosine, sine = x * x - y * y, 2 * x * y
    parts = []
    for angle in np.arange(4) * np.pi / 2:
        part = np.maximum(np.float32(np.cos(angle)) * cosine + np.float32(np.sin(angle)) * sine, 0) * strength
        part = cv2.resize(cv2.GaussianBlur(part, (0, 0), 0.6 * cell_px), (columns, rows), interpolation=cv2.INTER_AREA)
        parts.append(part - part.mean())
    return np.stack(parts, axis=-1).astype(np.float32)


def energies(cells: np.ndarray) -> np.ndarray:
    """Integral image of the squares of cells (h x w x 4)."""
    return cv2.integral((cells * cells).sum(axis=-1), sdepth=cv2.CV_64F)


def within(integral: np.ndarray, left: np.ndarray, top: np.ndarray, end: np.ndarray, bottom: np.ndarray) -> np.ndarray:
    """Sums over rectangles, whose right column and lowest row are no longer theirs."""
    return integral[top, left] + integral[bottom, end] - integral[top, end] - integral[bottom, left]


def edge_correlations(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Correlation of two pictures' cells (h x w x 4) for every scale and shift: SCALES x shifts down x shifts right."""
    height, width = first.shape[:2]
    down, right = int(MOST_SHIFT_Y * height), int(MOST_SHIFT_X * width)
    padded = cv2.copyMakeBorder(second, down, down, right, right, cv2.BORDER_CONSTANT)
    column, row = np.meshgrid(np.arange(-right, right + 1), np.arange(-down, down + 1))
    energy = energies(second)
    found = []
    for scale in MOST_SCALE ** np.linspace(-1, 1, SCALES):
        onto = np.array([[scale, 0, (1 - scale) * (width - 1) / 2], [0, scale, (1 - scale) * (height - 1) / 2]])
        scaled = cv2.warpAffine(first, onto, (width, height))
        products = cv2.matchTemplate(padded, scaled, cv2.TM_CCORR)
        # What of the second picture the first one fills, where it is shifted to.
        beside, above = (max(int(np.ceil((1 - scale) * (length - 1) / 2)), 0) for length in (width, height))
        left, top = np.maximum(beside + column, 0), np.maximum(above + row, 0)
        end, bottom = np.minimum(width - beside + column, width), np.minimum(height - above + row, height)
        shared = within(energy, left, top, end, bottom)
        shared = shared * within(energies(scaled), left - column, top - row, end - column, bottom - row)
        found.append(products / np.sqrt(np.maximum(shared, 1e-3)))
    return np.stack(found)


def vertex(values: np.ndarray) -> float:
    """Where a parabola through three values a step apart is highest, in steps from the middle one."""
    curvature = values[0] - 2 * values[1] + values[2]
    return 0.0 if curvature >= 0 else float(np.clip((values[0] - values[2]) / (2 * curvature), -0.5, 0.5))


def edge_agreement(first: np.ndarray, second: np.ndarray) -> float:
    """How well the fine cells of two aligned pictures agree: block by block, where it is best, by the strength of the edges."""
    found, weights = [], []
    for row in range(0, second.shape[0] - BLOCK_CELLS + 1, BLOCK_CELLS):
        for column in range(0, second.shape[1] - BLOCK_CELLS + 1, BLOCK_CELLS):
            block = second[row : row + BLOCK_CELLS, column : column + BLOCK_CELLS]
            weight = float(np.linalg.norm(block))
            if weight**2 < 1e-3:
                continue
            near = first[
                max(row - PARALLAX_CELLS, 0) : row + BLOCK_CELLS + PARALLAX_CELLS,
                max(column - PARALLAX_CELLS, 0) : column + BLOCK_CELLS + PARALLAX_CELLS,
            ]
            found.append(cv2.matchTemplate(near, block, cv2.TM_CCORR_NORMED).max())
            weights.append(weight)
    return float(np.average(found, weights=weights)) if found else 0.0


def by_edges(first: np.ndarray, second: np.ndarray) -> Optional[np.ndarray]:
    """As by_features, from all edges at once: a scale and a shift. None where nothing fits clearly."""
    found = edge_correlations(edge_cells(first), edge_cells(second))
    peak = np.unravel_index(found.argmax(), found.shape)
    elsewhere = np.ones(found.shape[1:], bool)
    elsewhere[max(peak[1] - LEAD_CELLS, 0) : peak[1] + LEAD_CELLS + 1, max(peak[2] - LEAD_CELLS, 0) : peak[2] + LEAD_CELLS + 1] = False
    refined = [float(index) for index in peak]
    for axis, index in enumerate(peak):
        if 0 < index < found.shape[axis] - 1:
            line = found[tuple(slice(None) if other == axis else at for other, at in enumerate(peak))]
            refined[axis] += vertex(line[index - 1 : index + 2])
    scale = MOST_SCALE ** (2 * refined[0] / (SCALES - 1) - 1)
    height, width = first.shape[:2]
    rows = round(EDGE_COLUMNS * height / width)
    homography = np.diag([scale, scale, 1.0])
    for axis, (cells, pixels, at) in enumerate(((EDGE_COLUMNS, width, refined[2]), (rows, height, refined[1]))):
        shift = at - (found.shape[2 - axis] - 1) / 2
        cell_px = pixels / cells
        homography[axis, 2] = ((1 - scale) * (cells - 1) / 2 + shift) * cell_px + (1 - scale) * (cell_px - 1) / 2
    aligned = cv2.warpPerspective(first, homography, (width, height), borderMode=cv2.BORDER_REPLICATE)
    agreement = edge_agreement(edge_cells(aligned, FINE_COLUMNS), edge_cells(second, FINE_COLUMNS))
    evidence = 2 * found[peak] - found[:, elsewhere].max() + agreement
    return homography if evidence >= LEAST_EVIDENCE else None


def as_on_board(first: np.ndarray, second: np.ndarray) -> Optional[np.ndarray]:
    """By edges, else by features: what a vehicle registers pictures with."""
    homography = by_edges(first, second)
    return by_features(first, second) if homography is None else homography


def camera_matrix(fx: float, fy: float, cx: float, cy: float) -> np.ndarray:
    """3 x 3 intrinsics, pixels."""
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])


def rotation_of(quaternion: np.ndarray) -> np.ndarray:
    """(x, y, z, w) to 3 x 3."""
    x, y, z, w = quaternion / np.linalg.norm(quaternion)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])


def by_plane(first_pose: np.ndarray, second_pose: np.ndarray, intrinsics: np.ndarray, depth_m: float) -> np.ndarray:
    """First picture's pixels to the second's for what lies on a wall `depth_m` ahead of the first camera.

    Poses are (tx, ty, tz, qx, qy, qz, qw) of the optical frames in the world.
    """
    first, second = rotation_of(first_pose[3:]), rotation_of(second_pose[3:])
    rotation = second.T @ first
    translation = second.T @ (first_pose[:3] - second_pose[:3])
    homography = intrinsics @ (rotation + np.outer(translation, [0, 0, 1 / depth_m])) @ np.linalg.inv(intrinsics)
    return homography / homography[2, 2]
