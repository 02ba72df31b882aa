#!/usr/bin/python3
"""What roslaunch makes of our launch files: every parameter has its default and can be set by an argument."""

import pathlib
import subprocess
import unittest
from xml.etree import ElementTree

import yaml
from roslaunch.config import ROSLaunchConfig
from roslaunch.xmlloader import XmlLoader

ROOT = pathlib.Path(__file__).resolve().parents[2]
BAG = ROOT / "rosbags/town.bag"
NODES = {
    "vehicle": {"camera_ingest": "camera_ingest", "edge_vo": "edge_vo", "geo_localization": "geo_localization",
                "hazard_detection": "hazard_detection", "hazard_reporting": "hazard_reporting",
                 "mqtt_bridge": "mqtt_bridge_vehicle", "early_discard": "early_discard", "driver_alert": "driver_alert",
                 "change_detection": "change_detection", "gps_receiver": "gps_receiver",
                 "driver_speech": "driver_speech", "driver_page": "driver_page"},
    "zone": {"zone_cloudlet": "zone_cloudlet", "mqtt_bridge": "mqtt_bridge_zone", "candidate_intake": "candidate_intake",
             "hazard_detection": "hazard_detection"},
}


def configured(launch, *arguments):
    """What roslaunch would start, read in this process: its own takes seconds to begin."""
    configuration = ROSLaunchConfig()
    XmlLoader().load(str(ROOT / "launch" / launch), configuration, argv=list(arguments), verbose=False)
    return configuration


def parameters(launch, *arguments):
    """What roslaunch would put on the parameter server."""
    return {str(name): parameter.value for name, parameter in configured(launch, *arguments).params.items()}


def nodes(launch, *arguments):
    """Full names of what roslaunch would start."""
    return [f"{node.namespace}{node.name}" for node in configured(launch, *arguments).nodes]


def remapped(launch, node, *arguments):
    """Of a node's topics: by its own name, by the one outside."""
    wanted = [each for each in configured(launch, *arguments).nodes if each.name == node]
    return dict(wanted[0].remap_args)


def refused(launch, *arguments):
    """Exit status and error output of roslaunch."""
    return subprocess.run(["/usr/bin/roslaunch", "--nodes", str(ROOT / "launch" / launch), *arguments],
                          capture_output=True, text=True, check=False)


def changed(value):
    """Another value of the same type."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, (int, float)):
        return value + 1
    return "another" if isinstance(value, str) else []


class LaunchArguments(unittest.TestCase):
    def assert_refused(self, why, launch, *arguments):
        ended = refused(launch, *arguments)
        self.assertNotEqual(ended.returncode, 0)
        self.assertIn(why, ended.stderr)

    def test_every_parameter_of_every_node_can_be_set_by_the_argument_of_its_node(self):
        """Also those that another argument sets: what was said of the node itself holds."""
        for launch, nodes in NODES.items():
            for node, file in nodes.items():
                defaults = yaml.safe_load((ROOT / "config" / f"{file}.yaml").read_text())
                wanted = {key: changed(value) for key, value in defaults.items()}
                optional = {"edge_vo": ["vo:=true"], "geo_localization": ["vo:=true"], "early_discard": ["profile:=small"],
                            "change_detection": ["changes:=true"], "gps_receiver": ["receiver:=gpsd"],
                            "driver_speech": ["speech:=true"], "driver_page": ["page:=true"]}.get(node, [])
                dumped = parameters(f"{launch}.launch", *optional, f"{node}:={yaml.safe_dump(wanted, default_flow_style=True, width=9999).strip()}")
                for key, value in wanted.items():
                    self.assertEqual(dumped.get(f"/{node}/{key}"), value, f"{launch}.launch {node}: {key}")

    def test_what_an_argument_of_its_own_sets_can_be_set_by_the_argument_of_the_node_too(self):
        for launch in NODES:
            own = "tracking:=false" if launch == "vehicle" else "detect_for_small:=true"
            dumped = parameters(f"{launch}.launch", own, "model:=/models/one.yaml",
                                "hazard_detection:={model: /models/another.yaml, tracking: true}")
            self.assertEqual(dumped["/hazard_detection/model"], "/models/another.yaml", launch)
            self.assertIs(dumped["/hazard_detection/tracking"], True, launch)

    def test_texts_that_yaml_would_read_as_numbers_or_quotes_stay_as_they_are(self):
        dumped = parameters("vehicle.launch", "vehicle:=007", "drive:=2024_01", "zone:=1e3", "directory:=/home/o'neill")
        self.assertEqual(dumped["/hazard_reporting/database"], "/home/o'neill/local_hazards.sqlite3")
        odd = "/a b/$HOME \\t \"q\" #1: {x: y}, o'neill \u00fc"
        for launch, file in (("vehicle.launch", "/local_hazards.sqlite3"), ("zone.launch", "")):
            dumped_odd = parameters(launch, f"directory:={odd}", f"identity:={odd}")
            self.assertIn(odd + file, dumped_odd.values(), launch)
            self.assertEqual(dumped_odd["/mqtt_bridge/key_file"], f"{odd}/key.pem")
        self.assertEqual([dumped["/mqtt_bridge/user"], dumped["/hazard_reporting/drive_id"], dumped["/mqtt_bridge/zone"]],
                         ["007", "2024_01", "1e3"])
        credit = """(c) l'Institut, "open" data: {all} #1"""
        self.assertEqual(parameters("zone.launch", f"tile_attribution:={credit}")["/zone_cloudlet/tile_attribution"], credit)

    def test_a_small_vehicle_discards_early_and_has_no_detector(self):
        big, small = nodes("vehicle.launch"), nodes("vehicle.launch", "profile:=small")
        self.assertIn("/hazard_detection", big)
        self.assertNotIn("/early_discard", big)
        self.assertNotIn("/hazard_detection", small)
        self.assertIn("/early_discard", small)
        self.assertIn("/hazard_reporting", small)
        self.assert_refused("profile:=tiny is neither big nor small", "vehicle.launch", "profile:=tiny")

    def test_a_vehicle_reads_a_receiver_of_its_own_only_when_told_to(self):
        self.assertNotIn("/gps_receiver", nodes("vehicle.launch"))
        self.assertIn("/gps_receiver", nodes("vehicle.launch", "receiver:=gpsd"))
        dumped = parameters("vehicle.launch", "receiver:=gpsd", "localize:=true", "gps_receiver:={device: /dev/ttyACM0}")
        self.assertEqual(dumped["/gps_receiver/device"], "/dev/ttyACM0")
        self.assertEqual(dumped["/geo_localization/latency_s"], 0.0, "it stamps the measurement")
        self.assert_refused("receiver:=serial is neither none nor gpsd", "vehicle.launch", "receiver:=serial")

    def test_a_vehicle_detects_changes_only_when_told_to(self):
        self.assertNotIn("/change_detection", nodes("vehicle.launch"))
        self.assertIn("/change_detection", nodes("vehicle.launch", "changes:=true"))
        dumped = parameters("vehicle.launch", "changes:=true", "directory:=/var/car", "drive:=monday")
        self.assertEqual(dumped["/change_detection/directory"], "/var/car/places")
        self.assertEqual(dumped["/change_detection/drive_id"], "monday")

    def test_a_zone_detects_for_small_vehicles_unless_told_not_to(self):
        self.assertIn("/candidate_intake", nodes("zone.launch"))
        without = nodes("zone.launch", "detect_for_small:=false")
        self.assertNotIn("/candidate_intake", without)
        self.assertNotIn("/hazard_detection", without)

    def test_a_folder_of_certificates_gives_the_bridge_its_three_files_on_both_sides(self):
        for launch in NODES:
            dumped = parameters(f"{launch}.launch", "identity:=/etc/livemap/identity")
            for name, file in (("ca_file", "ca.pem"), ("certificate_file", "certificate.pem"), ("key_file", "key.pem")):
                self.assertEqual(dumped[f"/mqtt_bridge/{name}"], f"/etc/livemap/identity/{file}")

    def test_with_two_eyes_odometry_listens_to_the_depth_of_camera_ingest(self):
        wanted = {(): "camera/depth/image_raw", ("stereo:=true",): "camera_rect/depth/image_raw",
                  ("stereo:=true", "depth:=own/depth"): "own/depth"}
        for arguments, topic in wanted.items():
            remaps = remapped("vehicle.launch", "edge_vo", "vo:=true", *arguments)
            self.assertEqual(remaps["camera/depth/image_raw"], topic)

    def test_odometry_runs_with_the_eyes_there_are_unless_told_otherwise(self):
        """By default with one eye or more; by depth alone where that is asked for; not at all on a small vehicle."""
        wanted = {(): "auto", ("vo:=auto",): "auto", ("vo:=true",): "depth", ("vo:=false",): None,
                  ("profile:=small",): None, ("profile:=small", "vo:=auto"): "auto"}
        for arguments, eye in wanted.items():
            for launch in (["vehicle.launch"], ["replay.launch", f"bag:={BAG}", "check:=false"]):
                dumped = parameters(*launch, *arguments)
                self.assertEqual(dumped.get("/edge_vo/eye"), eye, (launch, arguments))
                runs = eye is not None
                self.assertEqual("/geo_localization/latency_s" in dumped, runs, (launch, arguments))
                self.assertEqual(dumped["/hazard_reporting/position_source"], "fused" if runs else "gps")
                self.assertIs(dumped["/hazard_reporting/publish_tf"], not runs)
                self.assertIs(dumped["/hazard_reporting/use_depth"], "vo:=true" in arguments)
        self.assertIs(parameters("vehicle.launch", "stereo:=true")["/hazard_reporting/use_depth"], True)
        self.assert_refused("vo:=both is neither auto, true nor false", "vehicle.launch", "vo:=both")

    def test_positions_by_fusion_are_refused_without_it_and_told_what_they_need(self):
        self.assert_refused("position_source:=fused needs localize:=true", "vehicle.launch", "vo:=false",
                            "position_source:=fused")
        for arguments in ((), ("vo:=true",), ("vo:=false", "localize:=true"), ("vo:=true", "position_source:=gps")):
            self.assertIn("/hazard_reporting", nodes("vehicle.launch", *arguments))

    def test_a_nodelet_that_does_not_load_is_tried_again_only_after_a_pause(self):
        for launch in ("vehicle.launch", "zone.launch"):
            loaded = [node for node in ElementTree.parse(ROOT / "launch" / launch).iter("node")
                      if node.get("respawn") == "true" and "Nodelet" in node.get("args", "")]
            self.assertGreater(len(loaded), 0, launch)
            for node in loaded:
                self.assertIn(node.get("respawn_delay"), ("$(arg respawn_delay)", "2"), node.get("name"))

    def test_a_replay_runs_the_detector_unless_told_otherwise_or_the_bags_labels_answer(self):
        wanted = {(): True, ("use_truth:=true",): False, ("detect:=false",): False,
                  ("use_truth:=true", "detect:=true"): True}
        for arguments, runs in wanted.items():
            self.assertEqual("/hazard_detection" in nodes("replay.launch", f"bag:={BAG}", *arguments), runs, arguments)

    def test_the_tf_of_a_bag_goes_where_it_is_wanted(self):
        for arguments, topic in (((), "tf"), (("bag_tf:=ground_truth/tf",), "ground_truth/tf")):
            self.assertEqual(remapped("replay.launch", "player", f"bag:={BAG}", *arguments)["tf"], topic)

    def test_a_replay_hands_its_arguments_on_to_the_vehicle(self):
        dumped = parameters("replay.launch", f"bag:={BAG}", "vehicle:=car-7", "hazard_reporting:={max_range_m: 12.5}")
        self.assertEqual(dumped["/mqtt_bridge/user"], "car-7")
        self.assertEqual(dumped["/hazard_reporting/max_range_m"], 12.5)


if __name__ == "__main__":
    unittest.main()
