"""The values that vehicle.launch would drive with, of the file's defaults and the arguments given, without ROS."""

import os
import re
import xml.etree.ElementTree

from broker_files import Usage
from vehicle_checks.finding import Unreadable, read_yaml


def as_python(text):
    """What roslaunch's $(eval ...) makes of an argument."""
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text


class LaunchValues:
    """values["camera_z"] is the text of an argument; `parameters` are those of a node."""

    def __init__(self, root, given):
        self.root = root
        file = root / "launch" / "vehicle.launch"
        entries = xml.etree.ElementTree.parse(file).getroot().findall("arg")
        own = self._own(given, {entry.get("name") for entry in entries if entry.get("doc")})
        self._texts = {}
        for entry in entries:
            name = entry.get("name")
            if name in own:
                self._texts[name] = own[name]
            else:
                self._texts[name] = self._substituted(entry.get("value") or entry.get("default") or "")
        self._nodes = {node: self._mapping(node) for node in
                       ("camera_ingest", "gps_receiver", "hazard_detection", "early_discard", "mqtt_bridge", "edge_vo")}

    @staticmethod
    def _own(given, known):
        own = {}
        for argument in given:
            name, separator, value = argument.partition(":=")
            if not separator or name not in known:
                raise Usage(f"'{argument}' is no argument:=value of vehicle.launch, ./livemap vehicle --help lists them")
            if any(ord(character) < 32 or ord(character) == 127 for character in value):
                raise Usage(f"the value of {name} has a control character")
            own[name] = value
        return own

    def _substituted(self, text):
        """The launch file's own text: it is trusted, the values that it names are data."""
        expression = re.fullmatch(r"\$\(eval (.*)\)", text, re.S)
        if expression:
            names = {name: as_python(value) for name, value in self._texts.items()}
            return str(eval(expression.group(1), {"__builtins__": {}, "str": str}, names))  # pylint: disable=eval-used
        replace = {"env": lambda name: os.environ.get(name, ""), "find": lambda _: str(self.root),
                   "arg": self._texts.__getitem__}
        return re.sub(r"\$\((env|find|arg) ([^)]*)\)", lambda match: replace[match.group(1)](match.group(2)), text)

    def _mapping(self, node):
        """What a node's own argument sets."""
        try:
            import yaml
        except ImportError:
            raise Usage("Python's yaml is not installed: ./livemap setup installs it") from None
        try:
            value = yaml.safe_load(self._texts[node])
        except (yaml.YAMLError, ValueError, RecursionError):
            value = None
        if not isinstance(value, dict):
            raise Usage(f"{node} is '{self._texts[node]}', accepted is a YAML mapping like {node}:='{{name: value}}'")
        return value

    def __getitem__(self, name):
        return self._texts[name]

    def is_true(self, name):
        return self._texts[name].lower() in ("true", "1")

    def number(self, name):
        """None where it is no number."""
        try:
            return float(self._texts[name])
        except ValueError:
            return None

    def parameter(self, node, name, argument=None, default=None):
        """A node's parameter: its own argument wins, then the launch argument, then the node's file."""
        if name in self._nodes[node]:
            return self._nodes[node][name]
        if argument is not None:
            return self._texts[argument]
        try:
            return read_yaml(self._texts[f"{node}_config"]).get(name, default)
        except Unreadable as reason:
            raise Usage(f"{node}_config: {reason}") from None

    def port(self, node, argument=None, default=None):
        value = self.parameter(node, "port", argument, default)
        try:
            port = int(value)
        except (TypeError, ValueError):
            port = 0
        if not 1 <= port <= 65535:
            raise Usage(f"the port of {node} is '{value}', accepted is a whole number from 1 to 65535")
        return port
