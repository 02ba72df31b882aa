"""Small drives as rosbags, complete or without what a test leaves out."""

import numpy as np
import rosbag
import rospy
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, NavSatFix
from tf2_msgs.msg import TFMessage

START_S = 1767268800
WIDTH, HEIGHT = 320, 200
FRAME = "camera_optical_frame"


def stamp(seconds):
    return rospy.Time.from_sec(START_S + seconds)


def with_header(message, seconds, frame=""):
    message.header.stamp, message.header.frame_id = stamp(seconds), frame
    return message


def raw_image(seconds, number=0):
    pixels = np.full((HEIGHT, WIDTH, 3), 40 + number, np.uint8)
    return with_header(Image(height=HEIGHT, width=WIDTH, encoding="bgr8", step=WIDTH * 3, data=pixels.tobytes()), seconds, FRAME)


def jpeg_image(seconds, number=0):
    import cv2
    file = cv2.imencode(".jpg", np.full((HEIGHT, WIDTH, 3), 40 + number, np.uint8))[1].tobytes()
    return with_header(CompressedImage(format="jpeg", data=file), seconds, FRAME)


def camera_info(seconds):
    info = with_header(CameraInfo(height=HEIGHT, width=WIDTH, distortion_model="plumb_bob", D=[0.0] * 5), seconds, FRAME)
    info.K = [250, 0, WIDTH / 2, 0, 250, HEIGHT / 2, 0, 0, 1]
    info.R = [1, 0, 0, 0, 1, 0, 0, 0, 1]
    info.P = [250, 0, WIDTH / 2, 0, 0, 250, HEIGHT / 2, 0, 0, 0, 1, 0]
    return info


def fix(seconds):
    message = with_header(NavSatFix(latitude=-28.45 + seconds * 1e-4, longitude=-52.8, altitude=500.0), seconds, "gps")
    message.position_covariance = [1.0, 0, 0, 0, 1.0, 0, 0, 0, 4.0]
    message.position_covariance_type = 1
    return message


def mounting(seconds):
    def transform(parent, child, x, z, quaternion):
        one = with_header(TransformStamped(child_frame_id=child), seconds, parent)
        one.transform.translation.x, one.transform.translation.z = x, z
        rotation = one.transform.rotation
        rotation.x, rotation.y, rotation.z, rotation.w = quaternion
        return one
    return TFMessage([transform("base_link", "camera_link", 1.5, 1.6, (0, 0, 0, 1)),
                      transform("camera_link", FRAME, 0, 0, (-0.5, 0.5, -0.5, 0.5))])


def write_drive(path, images="compressed", leave_out=(), rename=None, frames=20, compression="none", begin_again=0,
                replace=None):
    """A drive of `frames` images in 10 Hz. `images`: raw, compressed, both or none; `rename`: of topics; `replace`: a
    topic's messages by others; `begin_again`: that many times more with the same stamps."""
    topics = {"/camera/camera_info": camera_info, "/fix": fix}
    if images in ("raw", "both"):
        topics["/camera/image_raw"] = raw_image
    if images in ("compressed", "both"):
        topics["/camera/image_raw/compressed"] = jpeg_image
    topics.update(replace or {})
    with rosbag.Bag(str(path), "w", compression=compression) as bag:
        if "/tf_static" not in leave_out:
            bag.write("/tf_static", mounting(0), stamp(0))
        for number in range(frames * (1 + begin_again)):
            seconds = number / 10
            for name, make in topics.items():
                if name not in leave_out:
                    bag.write((rename or {}).get(name, name), make((number % frames) / 10), stamp(seconds))
    return path
