"""One zone that is split into two parts, each a real zone's process, and a region in whose accounts officials log in."""

import http.client
import json
import os
import subprocess
import urllib.parse

from region_fixture import ROOT, Region, Zone, directory_of
from map_page_fixture import HANG_S, LAT, LON

PASSWORD = "correct horse battery"
PYTHON = "/usr/bin/python3"


class Metropolis:
    """Zone metro, split into metro-1 and metro-2, and a region of both."""

    def __init__(self, folder, region_program, user_program):
        self.folder, self.region_program = folder, region_program
        whole, split = os.path.join(folder, "whole.geojson"), os.path.join(folder, "parts.geojson")
        ring = [[LON - 0.05, LAT - 0.05], [LON + 0.05, LAT - 0.05], [LON + 0.05, LAT + 0.05], [LON - 0.05, LAT + 0.05]]
        with open(whole, "w", encoding="utf-8") as file:
            json.dump({"type": "Feature", "id": "metro", "geometry": {"type": "Polygon", "coordinates": [ring + ring[:1]]},
                       "properties": {"name": "Metropolis", "brokers": [{"host": "localhost", "port": 8883}]}}, file)
        subprocess.run([PYTHON, os.path.join(ROOT, "scripts", "livemap_split_zone"), whole, "--zone", "metro", "--parts", "2",
                        "--out", split], check=True, capture_output=True)
        with open(split, encoding="utf-8") as file:
            features = json.load(file)["features"]
        self.parts = {feature["id"]: Zone(os.path.join(folder, feature["id"])) for feature in features}
        corners = []
        for feature in features:
            feature["properties"]["map"] = self.parts[feature["id"]].url
            corners.append([corner[:-1] for polygon in feature["geometry"]["coordinates"] for corner in polygon][0])
        # A place in each part, and one on the line between them.
        self.places = {feature["id"]: self.middle(ring) for feature, ring in zip(features, corners)}
        self.border = self.middle([corner for corner in corners[0] if corner in corners[1]])
        self.signed, self.authority = directory_of(features, folder)
        self.accounts = os.path.join(folder, "accounts")
        os.makedirs(self.accounts)
        for name, role in (("alice", "official"), ("vera", "viewer")):
            subprocess.run([user_program, "add", name, "--role", role, "--directory", self.accounts], input=PASSWORD + "\n",
                           text=True, check=True, capture_output=True)
        self.region = None

    @staticmethod
    def middle(corners):
        """(latitude, longitude)"""
        return tuple(sum(corner[axis] for corner in corners) / len(corners) for axis in (1, 0))

    def start(self, speaks=True):
        """`speaks`: the parts let the region's token speak for others."""
        for part in self.parts.values():
            if part.process is None:
                part.start()
        tokens = []
        for name, part in self.parts.items():
            path = os.path.join(self.folder, f"{name}.token")
            with open(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w", encoding="utf-8") as file:
                file.write((part.process.region_token if speaks else part.process.token) + "\n")
            tokens += ["--token", f"{name}={path}"]
        self.region = Region(self.region_program, os.path.join(self.folder, "region"), "--directory", self.signed, "--authority",
                             self.authority, "--accounts", self.accounts, *tokens)
        self.region.start()

    def report(self, name, place=None, class_name="pothole"):
        """A candidate; the id that its part gave it."""
        return self.parts[name].process.report(class_name, *(place or self.places[name]), picture=True)

    def close(self):
        if self.region:
            self.region.close()
        for part in self.parts.values():
            part.close()


class Client:
    """Somebody at a browser: keeps the cookie and the CSRF token."""

    def __init__(self, url):
        self.address = urllib.parse.urlsplit(url).netloc
        self.headers = {"Content-Type": "application/json"}

    def ask(self, method, path, body=None, **headers):
        """(status, what was answered)"""
        connection = http.client.HTTPConnection(self.address, timeout=HANG_S)
        try:
            text = None if body is None else json.dumps(body)
            connection.request(method, path, text, {**self.headers, **{name.replace("_", "-"): value for name, value in
                                                                       headers.items()}})
            answer = connection.getresponse()
            content = answer.read()
            self.cookie = answer.getheader("Set-Cookie")
            is_json = "json" in (answer.getheader("Content-Type") or "")
            return answer.status, json.loads(content) if is_json else content
        finally:
            connection.close()

    def log_in(self, name):
        status, told = self.ask("POST", "/api/v1/session", {"name": name, "password": PASSWORD})
        assert status == 200, told
        self.headers |= {"Cookie": self.cookie.split(";")[0], "X-CSRF-Token": told["csrf_token"]}
        return self

    def get(self, path):
        return self.ask("GET", path)

    def decide(self, hazard, what, body=None, **headers):
        return self.ask("POST", f"/api/v1/hazards/{hazard}/{what}", {} if body is None else body, **headers)

    def hazards(self, query=""):
        return {one["id"]: one for one in self.get("/api/v1/hazards" + query)[1]["features"]}
