"""What a recorded drive holds of what a vehicle needs: looked at before anything starts, told in sentences."""

import collections
import datetime
import os
import pathlib
import shlex

import genpy
import rosbag
import roslib.message
import yaml

from system_error import StartError

IMAGE, COMPRESSED, INFO, FIX = ("sensor_msgs/Image", "sensor_msgs/CompressedImage", "sensor_msgs/CameraInfo",
                                "sensor_msgs/NavSatFix")
TF, BOXES = "tf2_msgs/TFMessage", "livemap/DetectionArray"
BASE_FRAME = "base_link"
# So many transforms tell which frames there are; a bag can hold hours of them.
MOST_TRANSFORMS = 2000
# Of so many messages the stamps are looked at.
MOST_STAMPS = 20000
# A player waits through what a bag leaves out, so that one message of another year is a replay without end.
LONGEST_DRIVE_S = 24 * 3600

Wanted = collections.namedtuple("Wanted", "image camera_info fix")
DEFAULT_TOPICS = Wanted("camera/image_raw", "camera/camera_info", "fix")
Topic = collections.namedtuple("Topic", "type md5 count")


def paths_of(text):
    """The bags that a launch argument names: one, whatever its name holds, or several with blanks between."""
    whole = os.path.abspath(text)
    if os.path.lexists(whole):
        return [whole]
    try:
        parts = [os.path.abspath(part) for part in shlex.split(text)]
    except ValueError:
        parts = []
    return parts if len(parts) > 1 and all(map(os.path.lexists, parts)) else [whole]


def open_bag(path):
    """The bag; StartError with the way out where it is none."""
    path = pathlib.Path(path)
    if path.is_dir():
        inside = sorted(entry.name for entry in path.iterdir() if entry.suffix == ".bag")
        holds = f", which holds {len(inside)} bags, the first is '{inside[0]}'" if inside else ", which holds no bag"
        raise StartError(f"bag '{path}' is a folder{holds}: accepted is one file")
    if not path.is_file():
        raise StartError(f"bag '{path}' is not a file")
    try:
        if path.stat().st_size == 0:
            raise StartError(f"bag '{path}' is empty: not one byte was recorded")
        return rosbag.Bag(str(path))
    except rosbag.ROSBagUnindexedException as error:
        raise StartError(f"bag '{path}' has no index, because its recording was cut off: "
                         f"'rosbag reindex {shlex.quote(str(path))}' makes one") from error
    except PermissionError as error:
        raise StartError(f"bag '{path}' cannot be read: {error.strerror}") from error
    # What is no bag at all fails in many ways, each with an exception of its own.
    except Exception as error:
        if isinstance(error, StartError):
            raise
        raise StartError(f"'{path}' is not a whole rosbag ({one_line(error)})") from error


def one_line(error):
    return " ".join(str(error).split()) or type(error).__name__


class DriveBag:
    """Topics, times and frames of one or more bags that are played as one."""

    def __init__(self, paths):
        self.paths = [str(path) for path in paths]
        self.name = f"bag '{self.paths[0]}'" if len(self.paths) == 1 else f"bags {', '.join(map(repr, self.paths))}"
        self.topics = {}
        starts, ends = [], []
        for path in self.paths:
            with open_bag(path) as bag:
                self._take_topics(path, bag)
                try:
                    starts.append(bag.get_start_time())
                    ends.append(bag.get_end_time())
                except rosbag.ROSBagException:
                    continue  # It holds nothing; another may.
        if not starts:
            raise StartError(f"{self.name} holds no message")
        self.start_s, self.end_s = min(starts), max(ends)

    def _take_topics(self, path, bag):
        try:
            info = bag.get_type_and_topic_info()
        except Exception as error:  # As in open_bag.
            raise StartError(f"'{path}' is not a whole rosbag ({one_line(error)})") from error
        for name, topic in info.topics.items():
            known = self.topics.get(key(name), Topic(topic.msg_type, info.msg_types.get(topic.msg_type), 0))
            self.topics[key(name)] = known._replace(count=known.count + topic.message_count)

    def has(self, name, kind):
        topic = self.topics.get(key(name))
        return topic is not None and topic.type == kind and topic.count > 0 and defined_as_here(topic)

    def messages(self, names, most):
        """Up to `most` messages of these topics."""
        left = most
        for path in self.paths:
            with open_bag(path) as bag:
                wanted = [name for name in bag.get_type_and_topic_info().topics if key(name) in map(key, names)]
                if not wanted:
                    continue
                try:
                    for name, message, _ in bag.read_messages(wanted):
                        if left <= 0:
                            return
                        left -= 1
                        yield key(name), message
                except Exception as error:  # As in open_bag.
                    raise StartError(f"'{path}' cannot be read to its end ({one_line(error)}): "
                                     f"'rosbag fix' or 'rosbag reindex' may save the rest") from error

    def lack(self, what, name, kind):
        """"no fixes: looked for sensor_msgs/NavSatFix under /fix", and what stands there or elsewhere instead."""
        topic = self.topics.get(key(name))
        if topic is not None and topic.type != kind:
            return f"no {what}: /{key(name)} holds {topic.type}, wanted is {kind}"
        if topic is not None and topic.count > 0:
            return f"no {what} that can be read: {kind} under /{key(name)} is defined otherwise than here"
        return f"no {what}: looked for {kind} under /{key(name)}{self.elsewhere(kind)}"

    def elsewhere(self, *kinds):
        """", but it has /a and /b": topics with messages of these kinds that might be meant instead."""
        found = sorted("/" + other for other, held in self.topics.items()
                       if held.type in kinds and held.count > 0 and not other.startswith("ground_truth/")
                       and "depth" not in other)
        return f", but it has {' and '.join(found[:3])}" if found else ""

    def transport_of(self, image):
        """"compressed" or "raw": as which of the two the images are there; compressed where both are, None where none
        is."""
        if self.has(image + "/compressed", COMPRESSED):
            return "compressed"
        return "raw" if self.has(image, IMAGE) else None

    def frames(self, image, transport):
        return self.topics[key(image + ("/compressed" if transport == "compressed" else ""))].count

    def frame_of(self, image, transport):
        """The tf frame of the images."""
        for _, message in self.messages([image + ("/compressed" if transport == "compressed" else "")], 1):
            return message.header.frame_id.lstrip("/")
        return ""

    def mounts(self, frame):
        """Whether the bag's tf leads from base_link to the frame."""
        neighbours = collections.defaultdict(set)
        for name in ("tf_static", "tf"):
            if not self.has(name, TF):
                continue
            for _, message in self.messages([name], MOST_TRANSFORMS):
                for transform in message.transforms:
                    ends = transform.header.frame_id.lstrip("/"), transform.child_frame_id.lstrip("/")
                    neighbours[ends[0]].add(ends[1])
                    neighbours[ends[1]].add(ends[0])
        reached, todo = {BASE_FRAME}, [BASE_FRAME]
        while todo:
            for other in neighbours[todo.pop()] - reached:
                reached.add(other)
                todo.append(other)
        return frame in reached

    def doubts_about_stamps(self, names):
        """A sentence per topic whose stamps go back or are missing."""
        last, doubts = {}, {}
        for name, message in self.messages(names, MOST_STAMPS):
            stamp = getattr(getattr(message, "header", None), "stamp", None)
            if stamp is None:
                continue
            if stamp == genpy.Time():
                doubts.setdefault(name, f"/{name} has messages without a stamp, which no position can be found for")
            elif name in last and stamp < last[name]:
                doubts.setdefault(name, f"the stamps of /{name} go back by {(last[name] - stamp).to_sec():.3g} s "
                                        f"at {stamp.to_sec():.3f}")
            last[name] = stamp
        return list(doubts.values())


def key(name):
    return name.lstrip("/")


def defined_as_here(topic):
    """A message of the same name but another definition never arrives."""
    here = roslib.message.get_message_class(topic.type)
    return here is None or topic.md5 in (None, "*") or here._md5sum == topic.md5


def faults_of(drive, topics, mounting_comes_from_bag, depth=None, boxes=False, fixes=True):
    """What the bag lacks without which a vehicle can use no frame of it, each as part of a sentence."""
    transport = drive.transport_of(topics.image)
    if transport is None:
        if key(topics.image) in drive.topics:
            fault = drive.lack("camera images", topics.image, IMAGE)
        elif key(topics.image + "/compressed") in drive.topics:
            fault = drive.lack("camera images", topics.image + "/compressed", COMPRESSED)
        else:
            fault = (f"no camera images: looked for {IMAGE} under /{key(topics.image)} and {COMPRESSED} under "
                     f"/{key(topics.image)}/compressed{drive.elsewhere(IMAGE, COMPRESSED)}")
        faults = [fault]
    else:
        faults = []
    if drive.end_s - drive.start_s > LONGEST_DRIVE_S:
        faults.append(f"messages from {date(drive.start_s)} to {date(drive.end_s)}, and a replay takes as long, accepted are "
                      f"{LONGEST_DRIVE_S // 3600} hours: 'rosbag filter IN OUT \"t.to_sec() < SECONDS\"' leaves out what is not of the drive")
    if not drive.has(topics.camera_info, INFO):
        faults.append(drive.lack("calibration of the camera", topics.camera_info, INFO))
    if fixes and not drive.has(topics.fix, FIX):
        faults.append(drive.lack("fixes of a receiver", topics.fix, FIX))
    if mounting_comes_from_bag and transport is not None:
        frame = drive.frame_of(topics.image, transport)
        if not drive.mounts(frame):
            faults.append(f"no mounting of the camera: looked for transforms from {BASE_FRAME} to '{frame}' under "
                          "/tf_static and /tf")
    if depth and not drive.has(depth, IMAGE):
        faults.append(drive.lack("depth images", depth, IMAGE))
    if boxes and not drive.has("ground_truth/boxes", BOXES):
        faults.append(drive.lack("true boxes", "ground_truth/boxes", BOXES))
    return faults


def date(time_s):
    return f"{datetime.datetime.fromtimestamp(time_s, datetime.timezone.utc):%Y-%m-%d %H:%M} UTC"


def as_sentence(drive, faults):
    return f"{drive.name} has " + "; it has ".join(faults)


def transport_wanted(given, node_argument, drive, image):
    """What camera_ingest is told: what the caller says, else what the bag holds."""
    try:
        own = (yaml.safe_load(node_argument or "{}") or {}).get("transport")
    except (yaml.YAMLError, AttributeError):
        own = None  # roslaunch says what is wrong with it.
    if own is not None:
        return own
    return given if given != "auto" else drive.transport_of(image) or "compressed"
