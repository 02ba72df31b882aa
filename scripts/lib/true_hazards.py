"""The true hazards of a drive: DRIVE.geojson beside DRIVE.bag, as `livemap simulate` writes it."""

import json
import math
import pathlib

from system_error import StartError

ACCEPTED = "accepted is a GeoJSON FeatureCollection of points with the property class, as livemap simulate --hazards writes it"


def truth_beside(bag):
    """The path of the drive's true hazards; None where the bag has none beside it."""
    truth = pathlib.Path(bag).with_suffix(".geojson")
    return truth if truth.is_file() else None


def read_true_hazards(path):
    """Class, longitude and latitude of each true hazard, and whether the vehicle passed it. StartError for any other file."""
    try:
        text = pathlib.Path(path).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise StartError(f"the true hazards '{path}' cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise StartError(f"the true hazards '{path}' are no text in UTF-8, {ACCEPTED}") from error
    try:
        collection = json.loads(text)
    except (ValueError, RecursionError) as error:
        where = f" (line {error.lineno})" if isinstance(error, json.JSONDecodeError) else ""
        raise StartError(f"the true hazards '{path}' are {'no JSON' + where if text.strip() else 'empty'}, {ACCEPTED}") from error
    features = collection.get("features") if isinstance(collection, dict) else None
    if not isinstance(features, list):
        raise StartError(f"the true hazards '{path}' have no list of features, {ACCEPTED}")
    return [_read_feature(feature, f"feature {number} of the true hazards '{path}'")
            for number, feature in enumerate(features, 1)]


def _read_feature(feature, name):
    properties = feature.get("properties") if isinstance(feature, dict) else None
    geometry = feature.get("geometry") if isinstance(feature, dict) else None
    hazard_class = properties.get("class") if isinstance(properties, dict) else None
    if not isinstance(hazard_class, str) or not hazard_class:
        raise StartError(f"{name} has no class, {ACCEPTED}")
    place = geometry.get("coordinates") if isinstance(geometry, dict) and geometry.get("type") == "Point" else None
    if not isinstance(place, list) or len(place) < 2 or not (_is_degrees(place[0], 180) and _is_degrees(place[1], 90)):
        raise StartError(f"{name} has no point with longitude and latitude in degrees, {ACCEPTED}")
    passed = properties.get("passed", True)
    if not isinstance(passed, bool):
        raise StartError(f"{name} has passed '{str(passed)[:40]}', accepted are true and false")
    return {"class": hazard_class, "longitude": place[0], "latitude": place[1], "passed": passed}


def _is_degrees(value, limit):
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value) and abs(value) <= limit
