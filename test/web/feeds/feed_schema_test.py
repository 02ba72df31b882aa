#!/usr/bin/python3
"""What a real zone's server answers as feeds is what the standards say: by their own schemas where those are there,
else by our own profiles of them (profiles/README.md), and by structure always. Every place lies in the town: a latitude near 40 and a longitude near -80, which no swap of
axes leaves as they are.

  feed_schema_test.py --server PATH_OF_map_page_server

The schemas of WZDx, GeoJSON and OGC API Features are third-party files, which are read from LIVEMAP_DATA_DIR (default
../shared/data). Without them those tests say "skipped, no data".
"""

import csv
import gzip
import io
import json
import os
import pathlib
import sys
import tempfile
import unittest
import urllib.error
import urllib.request

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "page"))
from map_page_fixture import OPTIONS, ZoneProcess  # noqa: E402
from map_page_streets_test import BLOCK_M, SCRIPT, at, write_town  # noqa: E402

try:
    import jsonschema
    import lxml.etree as etree
    import yaml
except ImportError:
    jsonschema = etree = yaml = None

ROOT = pathlib.Path(__file__).resolve().parents[3]
SCHEMAS = pathlib.Path(os.environ.get("LIVEMAP_DATA_DIR", ROOT.parent / "shared/data")) / "schemas"
WEST, SOUTH, EAST, NORTH = -80.0, 40.4, -79.9, 40.5
ATOM, GEORSS = "{http://www.w3.org/2005/Atom}", "{http://www.georss.org/georss}"
GPX = "{http://www.topografix.com/GPX/1/1}"
COM, LOC = "{http://datex2.eu/schema/3/common}", "{http://datex2.eu/schema/3/locationReferencing}"
SIT, XSI = "{http://datex2.eu/schema/3/situation}", "{http://www.w3.org/2001/XMLSchema-instance}"
PROFILES = pathlib.Path(__file__).with_name("profiles")
CHECKS = jsonschema.FormatChecker() if jsonschema else None


def json_profile(name):
    return jsonschema.Draft7Validator(json.loads((PROFILES / name).read_text()), format_checker=CHECKS)


def xml_profile(name):
    return etree.XMLSchema(etree.parse(str(PROFILES / name)))


def datex_profile():
    return xml_profile("datex_payload.xsd")


def json_schema(url):
    """A validator of one of the JSON schemas that name each other by URL."""
    store = {}
    for file in SCHEMAS.rglob("*.json"):
        schema = json.loads(file.read_text())
        store[schema.get("$id", file.as_uri())] = schema
    resolver = jsonschema.RefResolver(url, store[url], store=store)
    return jsonschema.Draft7Validator(store[url], resolver=resolver, format_checker=CHECKS)


def without_nullable(schema):
    """The same in JSON Schema, which says "nullable" by the type "null"."""
    if isinstance(schema, list):
        return [without_nullable(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    plain = {key: without_nullable(value) for key, value in schema.items() if key != "nullable"}
    if schema.get("nullable") and isinstance(schema.get("type"), str):
        plain["type"] = [schema["type"], "null"]
    return plain


def ogc_schema(name):
    """A validator of one of the OGC's YAML schemas, which name each other by file."""
    folder = SCHEMAS / "ogcapi/part1-1.0.1/core/openapi/schemas"

    def load(uri):
        return without_nullable(yaml.safe_load(pathlib.Path(uri[len("file://"):]).read_text()))

    uri = (folder / f"{name}.yaml").as_uri()
    resolver = jsonschema.RefResolver(uri, load(uri), handlers={"file": load})
    return jsonschema.Draft4Validator(load(uri), resolver=resolver, format_checker=CHECKS)


class Feeds(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        town = cls.folder.name + "/town.osm"
        write_town(town)
        cls.zone = ZoneProcess(town)
        cls.ids = {}
        for number, name in enumerate(("deer", "debris", "stopped_accident", "pothole", "road_work_sign", "barrier")):
            # On the street whose name is a script.
            cls.place(name, -3.5 * BLOCK_M + 150 * number, 0.5 * BLOCK_M)
        for east_m in (0, 20, 40):
            cls.place("traffic_cone", east_m, -0.5 * BLOCK_M)
        cls.candidate = cls.zone.report("debris", *at(0, 1.5 * BLOCK_M))
        cls.zone.change("sign", *at(10, 0))

    @classmethod
    def place(cls, name, east_m, north_m):
        for step in range(3):
            lat, lon = at(east_m - 20 + 10 * step, north_m)
            cls.zone.do("vehicle", id="car-1", lat=lat, lon=lon, course=1.5708, speed=10.0)
        cls.ids[name] = cls.zone.report(name, *at(east_m, north_m))
        cls.zone.do("confirm", id=cls.ids[name])

    @classmethod
    def tearDownClass(cls):
        cls.zone.close()
        cls.folder.cleanup()

    def get(self, path, **headers):
        request = urllib.request.Request(self.zone.url + path, headers={k.replace("_", "-"): v for k, v in headers.items()})
        with urllib.request.urlopen(request, timeout=30) as answer:
            return answer.read()

    def get_json(self, path):
        return json.loads(self.get(path))

    def status(self, path):
        try:
            self.get(path)
        except urllib.error.HTTPError as refusal:
            return refusal.code, json.loads(refusal.read())
        return 200, None

    def assert_in_town(self, lon, lat):
        self.assertTrue(WEST < float(lon) < EAST and SOUTH < float(lat) < NORTH, (lon, lat))

    def assert_positions_in_town(self, coordinates):
        if isinstance(coordinates[0], (int, float)):
            self.assert_in_town(*coordinates)
        else:
            for each in coordinates:
                self.assert_positions_in_town(each)

    def need(self, folder):
        if not (SCHEMAS / folder).is_dir():
            self.skipTest("skipped, no data")

    def test_wzdx_by_its_schema(self):
        self.need("wzdx")
        base = "https://raw.githubusercontent.com/usdot-jpo-ode/wzdx/main/schemas/4.2/"
        json_schema(base + "WorkZoneFeed.json").validate(self.get_json("feeds/wzdx.geojson"))

    def test_wzdx_by_structure(self):
        feed = self.get_json("feeds/wzdx.geojson")
        self.assertEqual(feed["feed_info"]["version"], "4.2")
        sizes = sorted(len(zone["geometry"]["coordinates"]) for zone in feed["features"])
        self.assertEqual(sizes, [1, 1, 3])  # Sign, barrier, three cones.
        for zone in feed["features"]:
            self.assert_positions_in_town(zone["geometry"]["coordinates"])
            self.assertIn("eastbound", zone["properties"]["core_details"]["direction"])
        names = {name for zone in feed["features"] for name in zone["properties"]["core_details"]["road_names"]}
        self.assertEqual(names, {SCRIPT, "5th Street"})

    def test_geojson_by_its_schema(self):
        self.need("geojson")
        schema = json_schema("https://geojson.org/schema/FeatureCollection.json")
        for path in ("feeds/wzdx.geojson", "ogc/collections/hazards/items", "ogc/collections/map_changes/items",
                     "ogc/collections/streets/items"):
            schema.validate(self.get_json(path))

    def test_ogc_by_its_schemas(self):
        self.need("ogcapi")
        for path, name in (("ogc", "landingPage"), ("ogc/conformance", "confClasses"),
                           ("ogc/collections", "collections"), ("ogc/collections/hazards", "collection"),
                           ("ogc/collections/hazards/items", "featureCollectionGeoJSON"),
                           ("ogc/collections/hazards/items?limit=2", "featureCollectionGeoJSON"),
                           ("ogc/collections/map_changes/items", "featureCollectionGeoJSON"),
                           ("ogc/collections/streets/items", "featureCollectionGeoJSON"),
                           (f"ogc/collections/hazards/items/{self.ids['deer']}", "featureGeoJSON")):
            ogc_schema(name).validate(self.get_json(path))
        code, refusal = self.status("ogc/collections/hazards/items?unknown=1")
        self.assertEqual(code, 400)
        ogc_schema("exception").validate(refusal)

    def test_ogc_by_structure(self):
        seen, path = [], "ogc/collections/hazards/items?limit=3"
        while path:
            page = self.get_json(path)
            self.assertEqual(page["numberReturned"], len(page["features"]))
            for feature in page["features"]:
                self.assert_positions_in_town(feature["geometry"]["coordinates"])
                seen.append(feature["id"])
            links = {link["rel"]: link["href"] for link in page["links"]}
            self.assertTrue(links["self"].startswith(self.zone.url))
            path = links.get("next", self.zone.url)[len(self.zone.url):]
        self.assertEqual(len(seen), 10)
        self.assertEqual(len(set(seen)), 10)
        for feature in self.get_json("ogc/collections/streets/items")["features"]:
            self.assert_positions_in_town(feature["geometry"]["coordinates"])
            self.assertGreater(feature["properties"]["hazards"], 0)
        for bad in ("bbox=1,2,3", "bbox=40,-80,41,-200", "datetime=yesterday", "limit=0", "limit=x", "crs=1", "cursor=-1"):
            code, refusal = self.status("ogc/collections/hazards/items?" + bad)
            self.assertEqual((code, refusal["code"]), (400, "InvalidParameterValue"), bad)

    def test_cifs(self):
        feed = self.get_json("feeds/cifs.json")
        json_profile("cifs.json").validate(feed)
        incidents = [each["incident"] for each in feed["incidents"]]
        self.assertEqual(len({incident["id"] for incident in incidents}), 9)
        for incident in incidents:
            self.assertLess(incident["starttime"], incident["endtime"])
            numbers = incident["polyline"].split()
            self.assertEqual(len(numbers), 4 if incident["direction"] == "ONE_DIRECTION" else 2)
            for lat, lon in zip(numbers[::2], numbers[1::2]):
                self.assert_in_town(lon, lat)
        self.assertIn(SCRIPT, {incident["street"] for incident in incidents})

    def test_datex(self):
        root = etree.fromstring(self.get("feeds/srti.xml"))
        datex_profile().assertValid(root)
        self.assertEqual(root.get(XSI + "type"), "sit:SituationPublication")
        kinds = {}
        for record in root.iter(SIT + "situationRecord"):
            self.assert_in_town(record.find(f".//{LOC}longitude").text, record.find(f".//{LOC}latitude").text)
            start, end = (record.find(f".//{COM}overall{side}Time").text for side in ("Start", "End"))
            self.assertLess(start, end)
            kinds.setdefault(record.get(XSI + "type"), []).append(record[-1].text)
        self.assertEqual(kinds, {"sit:AnimalPresenceObstruction": ["wildAnimalsOnTheRoad"],
                                 "sit:GeneralObstruction": ["debris", "unprotectedAccidentArea"],
                                 "sit:MaintenanceWorks": ["roadworks"] * 5})

    def test_denm(self):
        lines = [json.loads(line) for line in self.get("feeds/denm.ndjson").splitlines()]
        self.assertEqual(len(lines), 9)
        self.assertEqual(len({json.dumps(line["message"]["denm"]["management"]["actionID"]) for line in lines}), 9)
        profile = json_profile("denm.json")
        for line in lines:
            self.assertEqual(set(line), {"id", "message"})
            profile.validate(line["message"])
            management = line["message"]["denm"]["management"]
            position = management["eventPosition"]
            self.assert_in_town(position["longitude"] / 1e7, position["latitude"] / 1e7)
            self.assertGreaterEqual(management["referenceTime"], management["detectionTime"])
        self.zone.do("reject", id=self.ids["pothole"])
        ended = self.get_json(f"feeds/denm/{self.ids['pothole']}")
        self.zone.do("confirm", id=self.ids["pothole"])
        profile.validate(ended)
        self.assertEqual(ended["denm"]["management"]["termination"], "isNegation")

    def test_the_profiles_refuse_what_is_wrong(self):
        cifs, denm = json_profile("cifs.json"), json_profile("denm.json")
        lines = [json.loads(line)["message"] for line in self.get("feeds/denm.ndjson").splitlines()]
        feed = self.get_json("feeds/cifs.json")

        def changed(document, path, value):
            copy = json.loads(json.dumps(document))
            *way, last = path
            place = copy
            for step in way:
                place = place[step]
            place.pop(last) if value is None else place.__setitem__(last, value)
            return copy

        incident = ("incidents", 0, "incident")
        for path, value in ((incident + ("polyline",), "-179.943600 40.443300"), (incident + ("street",), None),
                            (incident + ("type",), "ROAD_CLOSED"), (incident + ("subtype",), "ACCIDENT_MAJOR"),
                            (incident + ("starttime",), "2026-01-01 00:00"), (incident + ("direction",), "EAST"),
                            (incident + ("more",), 1)):
            self.assertFalse(cifs.is_valid(changed(feed, path, value)), f"CIFS with {path[-1]} {value}")
        management = ("denm", "management")
        for path, value in ((management + ("termination",), "isNegation"), (management + ("stationType",), None),
                            (management + ("eventPosition", "latitude"), 1799436000), (("denm", "location"), None),
                            (management + ("actionID", "sequenceNumber"), 65536), (management + ("actionId",), {}),
                            (("denm", "situation", "eventType", "causeCode"), 94),
                            (("denm", "situation", "informationQuality"), 8), (("denm", "location", "traces"), [])):
            self.assertFalse(denm.is_valid(changed(lines[0], path, value)), f"DENM with {path[-1]} {value}")
        text = self.get("feeds/srti.xml").decode()
        self.assertTrue(datex_profile().validate(etree.fromstring(text.encode())))
        for old, new in (("latitude>40", "latitude>140"), ("riskOf", "maybe"), ("probable", "maybe"), ("certain", "maybe"),
                         ('modelBaseVersion="3"', 'modelBaseVersion="2"'), ("sit:GeneralObstruction", "sit:Accident"),
                         ("wildAnimalsOnTheRoad", "deer"), ("country>zz<", "country>other<"), ("<sit:safetyRelatedMessage>true</sit:safetyRelatedMessage>", ""),
                         ("sit:validity>", "sit:Validity>"), ("sit:commentType>", "com:commentType>")):
            if old in text:
                wrong = etree.fromstring(text.replace(old, new).encode())
                self.assertFalse(datex_profile().validate(wrong), f"DATEX II with {new} for {old}")
        for name, profile, old, new in (("atom", "atom.xsd", "point>40", "point>140"), ("atom", "atom.xsd", "<published>", "<published>on "),
                                        ("atom", "atom.xsd", "summary>", "content>"), ("gpx", "gpx.xsd", 'lat="40', 'lat="140'),
                                        ("gpx", "gpx.xsd", "wpt", "waypoint"), ("gpx", "gpx.xsd", 'version="1.1"', 'version="1.0"')):
            text = self.get("feeds/hazards." + name).decode()
            self.assertIn(old, text)
            wrong = etree.fromstring(text.replace(old, new).encode())
            self.assertFalse(xml_profile(profile).validate(wrong), f"{name} with {new} for {old}")

    def test_georss(self):
        root = etree.fromstring(self.get("feeds/hazards.atom"))
        xml_profile("atom.xsd").assertValid(root)
        for tag in ("id", "title", "updated", "author"):
            self.assertEqual(len(root.findall(ATOM + tag)), 1, tag)
        entries = root.findall(ATOM + "entry")
        self.assertEqual(len(entries), 10)
        self.assertEqual(len({entry.find(ATOM + "id").text for entry in entries}), 10)
        for entry in entries:
            self.assertTrue(entry.find(ATOM + "title").text and entry.find(ATOM + "updated").text)
            lat, lon = entry.find(GEORSS + "point").text.split()
            self.assert_in_town(lon, lat)
        self.assertTrue(any(SCRIPT in entry.find(ATOM + "title").text for entry in entries))

    def test_gpx(self):
        root = etree.fromstring(self.get("feeds/hazards.gpx"))
        xml_profile("gpx.xsd").assertValid(root)
        self.assertEqual((root.tag, root.get("version")), (GPX + "gpx", "1.1"))
        points = root.findall(GPX + "wpt")
        self.assertEqual(len(points), 10)
        for point in points:
            self.assert_in_town(point.get("lon"), point.get("lat"))
            order = [("time", "name", "desc", "type").index(child.tag[len(GPX):]) for child in point]
            self.assertEqual(order, sorted(order))

    def test_csv(self):
        text = self.get("feeds/hazards.csv").decode()
        self.assertEqual(text.count("\r\n"), 11)
        rows = list(csv.DictReader(io.StringIO(text)))
        self.assertEqual(len(rows), 10)
        for row in rows:
            self.assertNotIn(None, row)
            self.assert_in_town(row["longitude"], row["latitude"])
        self.assertIn(self.candidate, {row["id"] for row in rows})

    def test_gzip_and_etag(self):
        request = urllib.request.Request(self.zone.url + "feeds/srti.xml", headers={"Accept-Encoding": "gzip"})
        with urllib.request.urlopen(request, timeout=30) as answer:
            tag = answer.headers["ETag"]
            self.assertTrue(gzip.decompress(answer.read()).startswith(b"<?xml"))
        with self.assertRaises(urllib.error.HTTPError) as unchanged:
            self.get("feeds/srti.xml", If_None_Match=tag)
        self.assertEqual(unchanged.exception.code, 304)
        unchanged.exception.close()


def main():
    arguments = sys.argv[1:]
    if "--server" not in arguments:
        sys.exit("feed_schema_test.py: --server is missing, accepted is the built map_page_server")
    OPTIONS.server = arguments.pop(arguments.index("--server") + 1)
    arguments.remove("--server")
    if jsonschema is None:
        print("skipped: python3-jsonschema, python3-lxml or python3-yaml is not installed")
        return 1 if os.environ.get("CI") else 77
    program = unittest.main(argv=[sys.argv[0], *arguments], exit=False, verbosity=2)
    return 0 if program.result.wasSuccessful() else 1


if __name__ == "__main__":
    sys.exit(main())
