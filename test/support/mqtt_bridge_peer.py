#!/usr/bin/python3
"""One program on one ROS master, steered over pipes: a process can talk to one master only, and the
test of the bridge needs two.

Arguments: pub:TOPIC:TYPE and sub:TOPIC:TYPE. Every line on stdin, {"topic": ..., "data": BASE64}, is
published once somebody listens; every received message is such a line on stdout."""

import base64
import json
import sys
import threading

import roslib.message
import rospy


def main():
    rospy.init_node("peer", anonymous=True, disable_signals=True)
    output = threading.Lock()

    def tell(line):
        with output:
            sys.stdout.write(json.dumps(line) + "\n")
            sys.stdout.flush()

    publishers = {}
    for argument in rospy.myargv()[1:]:
        direction, topic, type_name = argument.split(":")
        if direction == "pub":
            message_class = roslib.message.get_message_class(type_name)
            publishers[topic] = rospy.Publisher(topic, message_class, queue_size=100)
        else:
            rospy.Subscriber(topic, rospy.AnyMsg, lambda message, topic=topic: tell(
                {"topic": topic, "data": base64.b64encode(message._buff).decode()}))
    tell({"ready": True})
    for line in sys.stdin:
        command = json.loads(line)
        publisher = publishers[command["topic"]]
        while publisher.get_num_connections() == 0:
            rospy.rostime.wallsleep(0.02)
        message = publisher.data_class()
        message.deserialize(base64.b64decode(command["data"]))
        publisher.publish(message)


if __name__ == "__main__":
    main()
