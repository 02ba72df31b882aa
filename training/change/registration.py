"""Homographies between the pictures of a pair: from SIFT matches as the vehicle finds them, or from known poses."""

from typing import Optional

import cv2
import numpy as np

FEATURES = 1500
RATIO = 0.75
"""Best match's distance over the second best's (Lowe's ratio test)."""

REPROJECTION_PX = 3.0
LEAST_INLIERS = 15
LEAST_OVERLAP = 0.5
"""Of the picture that the warp has to fill."""


def overlap(homography: np.ndarray, width: int, height: int) -> float:
    """Share of a picture that its partner, warped by the homography, fills."""
    ones = np.full((height, width), 255, np.uint8)
    return float(cv2.warpPerspective(ones, homography, (width, height), flags=cv2.INTER_NEAREST).mean() / 255)


def by_features(first: np.ndarray, second: np.ndarray) -> Optional[np.ndarray]:
    """3 x 3 that takes pixels of the first picture (H x W x 3 uint8) to the second; None where they do not match."""
    sift = cv2.SIFT_create(FEATURES, contrastThreshold=0.02)
    sides = [sift.detectAndCompute(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), None) for image in (first, second)]
    if any(descriptors is None or len(descriptors) < LEAST_INLIERS for _, descriptors in sides):
        return None
    matches = cv2.BFMatcher().knnMatch(sides[0][1], sides[1][1], k=2)
    good = [pair[0] for pair in matches if len(pair) == 2 and pair[0].distance < RATIO * pair[1].distance]
    if len(good) < LEAST_INLIERS:
        return None
    points = [np.float32([keypoints[index].pt for index in indices]) for keypoints, indices in (
        (sides[0][0], [match.queryIdx for match in good]), (sides[1][0], [match.trainIdx for match in good]),
    )]
    cv2.setRNGSeed(1)
    homography, inliers = cv2.findHomography(points[0], points[1], cv2.RANSAC, REPROJECTION_PX, maxIters=1000)
    if homography is None or inliers.sum() < LEAST_INLIERS:
        return None
    height, width = second.shape[:2]
    return homography if overlap(homography, width, height) >= LEAST_OVERLAP else None


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
