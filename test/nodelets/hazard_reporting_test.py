#!/usr/bin/python3
"""hazard_reporting as the vehicle runs it: fixes and detections in, reports out."""

import glob
import math
import os
import sys
import time
import unittest

import rospy
import rostest
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import NavSatStatus

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "support"))
from hazard_reporting_fixture import (COURSE_RAD, HEIGHT, OPTICAL, SPEED_MPS, WIDTH, Vehicle, camera_image, decode,
                                      detection, detections, east_north, fix, middle_on_street, on_street, place, stamp)
from livemap.msg import (BestViews, ChangedObject, ChangedObjects, HazardNotice, HazardPoll, HazardPollAnswer, HazardReport,
                         LinkState, ReportReceipt)
from node_testing import eventually  # noqa: E402


def receipt(report, status=ReportReceipt.COMMITTED, hazard=9):
    return ReportReceipt(schema_version=ReportReceipt.SCHEMA_VERSION, status=status,
                         report_uuid=report.uuid, hazard_uuid=bytes([hazard] * 16))


def notice(action, sequence, where, hazard=7, **fields):
    latitude, longitude = place(*where)
    return HazardNotice(schema_version=HazardNotice.SCHEMA_VERSION, action=action,
                        sequence=sequence, hazard_uuid=bytes([hazard] * 16), class_name="pothole",
                        confidence=0.5, latitude=latitude, longitude=longitude, sightings=1, **fields)


def poll(number, where, life_s=60, **fields):
    """Is the pothole there still? The zone's clock is another one than the drive's."""
    latitude, longitude = place(*where)
    return HazardPoll(schema_version=HazardPoll.SCHEMA_VERSION, poll_uuid=bytes([number] * 16),
                      hazard_uuid=bytes([7] * 16), vehicle_id="car-1", stamp=rospy.Time(50),
                      expires=rospy.Time(50 + life_s), latitude=latitude, longitude=longitude,
                      covariance=[0.1, 0, 0, 0.1], **dict({"class_name": "pothole"}, **fields))


def changes(time_s, where, class_name, direction):
    """What change detection knows after the image of that time: one object."""
    latitude, longitude = place(*where)
    changed = ChangedObject(id=1, class_name=class_name, direction=direction, latitude=latitude, longitude=longitude,
                            covariance=[0.2, 0, 0, 0.2], confidence=0.75, seen=3, last_seen=stamp(time_s))
    message = ChangedObjects(drive_id="drive", objects=[changed])
    message.header.stamp = stamp(time_s)
    return message


class HazardReportingTest(unittest.TestCase):
    number = 0

    def make_vehicle(self, **parameters):
        HazardReportingTest.number += 1
        vehicle = Vehicle(f"vehicle{HazardReportingTest.number}", **parameters)
        self.addCleanup(vehicle.stop)
        return vehicle

    def driving_vehicle(self, **parameters):
        vehicle = self.make_vehicle(**parameters)
        vehicle.start()
        vehicle.mount_camera()
        vehicle.drive(0, 4)
        return vehicle

    def test_reports_the_hazard_itself_at_its_place_with_its_picture(self):
        vehicle = self.driving_vehicle(drive_id="drive-7")
        vehicle.see(3.05, detection(12.0, -1.5))
        report = eventually(vehicle.reports, "a report")[0]
        where = east_north(report.latitude, report.longitude)
        self.assertLess(math.dist(where, middle_on_street(3.05, 12.0, -1.5)), 0.02)
        self.assertEqual(report.schema_version, HazardReport.SCHEMA_VERSION)
        self.assertEqual((report.class_name, report.drive_id), ("pothole", "drive-7"))
        self.assertEqual(report.vehicle_id, "")
        self.assertEqual(report.stamp, stamp(3.05))
        self.assertEqual(report.image.header.stamp, report.stamp)
        self.assertEqual(report.image.header.frame_id, OPTICAL)
        self.assertEqual((report.image_width, report.image_height), (640, 400))
        # What it shows: the hazard and its surroundings, in few bytes.
        self.assertEqual(decode(report.image).shape, (320, 480, 3))
        self.assertEqual((report.shown_width, report.shown_height), (480, 320))
        self.assertTrue(report.shown_x <= report.x_min and report.x_max <= report.shown_x + 480)
        self.assertTrue(report.shown_y <= report.y_min and report.y_max <= report.shown_y + 320)
        self.assertLessEqual(len(report.image.data), 12000)
        self.assertGreater(report.covariance[0] * report.covariance[3], report.covariance[1] ** 2)

    def test_makes_a_picture_only_when_a_sighting_is_news(self):
        vehicle = self.driving_vehicle()
        vehicle.see(3.0)
        vehicle.see(3.1, detection(12.0))
        vehicle.see(3.2, detection(10.4))
        vehicle.publish("hazard/detections", detections(3.3, detection(9.0, 3.0, "debris")))
        vehicle.wait_for(reports_created=1, duplicates_suppressed=1, pictures_requested=1, pictures_made=1,
                         reports_without_picture=0)
        # On a slow machine the report has been sent again by now.
        self.assertEqual({report.class_name for report in vehicle.reports()}, {"pothole"})

    def test_an_image_that_does_not_come_is_waited_for_shortly_and_the_report_goes_without(self):
        vehicle = self.driving_vehicle()
        vehicle.publish("hazard/events", detections(3.1, detection(12.0)))
        report = eventually(vehicle.reports, "a report")[0]
        self.assertEqual((report.image.format, len(report.image.data)), ("", 0))
        vehicle.wait_for(reports_without_picture=1, pictures_requested=0)

    def test_without_events_every_detection_counts(self):
        vehicle = self.driving_vehicle(use_events=False, picture_context=0.0, max_image_bytes=100000)
        vehicle.see(3.1, detection(12.0))
        report = eventually(vehicle.reports, "a report")[0]
        self.assertEqual(decode(report.image).shape, (400, 640, 3))
        self.assertEqual((report.shown_x, report.shown_y, report.shown_width, report.shown_height), (0, 0, 640, 400))

    def test_the_image_of_a_best_view_is_kept_until_its_event_comes(self):
        vehicle = self.driving_vehicle(picture_frames=2)
        view = camera_image(3.1)
        view.data = bytes([200, 20, 20]) * (WIDTH * HEIGHT)
        vehicle.publish("hazard/best_views", BestViews(stamps=[stamp(3.1)]))
        rospy.sleep(0.5)
        for tenth in range(31, 36):
            vehicle.publish("camera_rect/image", view if tenth == 31 else camera_image(tenth / 10))
            vehicle.wait_for(images_kept=1 if tenth == 31 else 2)
            # The detection of the view is below the threshold: the tracker alone knows of it.
            vehicle.publish("hazard/detections", detections(tenth / 10))
            vehicle.wait_for(images_kept=1)
        vehicle.publish("hazard/events", detections(3.1, detection(12.0)))
        report = eventually(vehicle.reports, "a report")[0]
        self.assertEqual(report.stamp, stamp(3.1))
        blue, green, red = decode(report.image)[2, 2]
        self.assertTrue(blue > 150 and green < 60 and red < 60, "the picture of another image")

    def test_an_image_that_cannot_be_used_leaves_the_report_without_picture(self):
        vehicle = self.driving_vehicle()
        broken = camera_image(3.1)
        broken.encoding = "no encoding"
        vehicle.see(3.1, detection(12.0), image=broken)
        report = eventually(vehicle.reports, "a report")[0]
        self.assertEqual(len(report.image.data), 0)

    def deferring_vehicle(self, **parameters):
        """On a link that costs, with a report of rank 3 that waits."""
        vehicle = self.make_vehicle(resend_first_s=0.2, resend_longest_s=0.4, **parameters)
        vehicle.link(LinkState.METERED)
        vehicle.start()
        vehicle.wait_for(link="metered")
        vehicle.mount_camera()
        vehicle.drive(0, 4)
        vehicle.see(3.1, detection(12.0), detection(12.0, 2.0, "debris"))
        vehicle.wait_for(reports_created=2, pending=2, held=1)
        return vehicle

    def test_a_deferred_report_survives_kill_nine_and_goes_once_when_the_link_is_cheap(self):
        vehicle = self.deferring_vehicle()
        urgent = eventually(vehicle.reports, "what is urgent goes at once")[0]
        self.assertEqual(urgent.class_name, "debris")
        vehicle.publish("hazard/receipt", receipt(urgent))
        vehicle.wait_for(pending=1, held=1)
        vehicle.kill()
        vehicle.start()
        vehicle.wait_for(pending=1, held=1, reports_sent=0)
        rospy.sleep(1.0)
        self.assertEqual({report.class_name for report in vehicle.reports()}, {"debris"})
        vehicle.link(LinkState.CHEAP)
        deferred = eventually(lambda: [report for report in vehicle.reports() if report.class_name == "pothole"],
                              "it goes")[0]
        self.assertEqual(deferred.stamp, stamp(3.1))
        self.assertEqual(decode(deferred.image).shape, (320, 480, 3))
        vehicle.publish("hazard/receipt", receipt(deferred, hazard=8))
        vehicle.wait_for(pending=0, held=0, committed=1, reports_sent=1)
        count = len(vehicle.reports())
        rospy.sleep(1.0)
        self.assertEqual(len(vehicle.reports()), count, "a finished report is not sent again")
        self.assertEqual(len({bytes(report.uuid) for report in vehicle.reports()}), 2)

    def test_a_deferred_report_goes_at_its_limit_also_when_the_vehicle_was_off_meanwhile(self):
        began = time.time()
        vehicle = self.deferring_vehicle(hold_later_s=25.0)
        vehicle.kill()
        vehicle.start()
        deferred = eventually(lambda: [report for report in vehicle.reports() if report.class_name == "pothole"],
                              "it goes")
        self.assertGreater(time.time() - began, 25.0)
        vehicle.wait_for(held=0, link="metered")
        self.assertEqual(len({bytes(report.uuid) for report in deferred}), 1)

    def test_tells_where_the_vehicle_is_once_a_second_and_shows_it(self):
        vehicle = self.driving_vehicle()
        eventually(lambda: len(vehicle.received("vehicle/position")) == 5, "five positions")
        last = vehicle.received("vehicle/position")[-1]
        self.assertEqual(last.stamp, stamp(4.0))
        self.assertLess(math.dist(east_north(last.latitude, last.longitude), on_street(4)), 0.01)
        self.assertAlmostEqual(last.speed, SPEED_MPS, delta=0.01)
        self.assertAlmostEqual(last.course, COURSE_RAD, delta=0.001)
        vehicle.see(3.05, detection(12.0))
        marker = eventually(
            lambda: [marker for array in vehicle.received("hazard/local_map")
                     for marker in array.markers if marker.ns == "hazards"], "a marker")[0]
        self.assertEqual(marker.header.frame_id, "map")
        # The map's origin is the first fix, where the course was not known yet.
        self.assertLess(math.dist((marker.pose.position.x, marker.pose.position.y),
                                  middle_on_street(3.05, 12.0)), 0.05)
        path = eventually(lambda: [path for path in vehicle.received("path") if path.poses],
                          "a path")[-1]
        self.assertLess(math.dist((path.poses[-1].pose.position.x, path.poses[-1].pose.position.y),
                                  on_street(4.0)), 2.0)

    def test_reports_a_hazard_seen_in_many_frames_once(self):
        vehicle = self.driving_vehicle()
        for frame in range(6):
            vehicle.see(3.0 + 0.1 * frame, detection(16.0 - 1.6 * frame))
        vehicle.wait_for(detections=6, duplicates_suppressed=5, reports_created=1, reports_sent=1,
                         pending=1)
        self.assertEqual(len({bytes(report.uuid) for report in vehicle.reports()}), 1)

    def test_does_not_report_what_the_zone_announced_until_it_is_removed(self):
        vehicle = self.driving_vehicle()
        vehicle.publish("hazard/notice", notice(HazardNotice.ADDED, 1, on_street(3.0, 13.0)))
        vehicle.wait_for(notices=1, known=1)
        vehicle.see(3.0, detection(12.0))
        vehicle.wait_for(duplicates_suppressed=1, reports_created=0)
        vehicle.publish("hazard/notice", notice(HazardNotice.REMOVED, 2, on_street(3.0, 13.0)))
        vehicle.wait_for(notices=2, known=0)
        vehicle.see(3.1, detection(10.4))
        vehicle.wait_for(reports_created=1)

    def test_a_hazard_removed_while_it_was_off_disappears_with_the_catch_up(self):
        vehicle = self.driving_vehicle()
        vehicle.publish("hazard/notice", notice(HazardNotice.ADDED, 1, on_street(3.0, 13.0)))
        vehicle.wait_for(known=1, map_sequence=1)
        vehicle.kill()
        vehicle.start()
        vehicle.drive(5, 7)
        eventually(lambda: vehicle.received("vehicle/position")[-1].map_sequence == 1,
                   "it says from where it needs to be told")
        vehicle.publish("hazard/notice",
                        notice(HazardNotice.ADDED, 3, on_street(9.0), hazard=8, previous_sequence=2))
        vehicle.wait_for(known=2, map_sequence=1)
        own = {"vehicle_id": "car-1"}
        vehicle.publish("hazard/notice", notice(HazardNotice.REMOVED, 2, on_street(3.0, 13.0), **own))
        vehicle.publish("hazard/notice", notice(HazardNotice.CAUGHT_UP, 2, on_street(3.0), hazard=0,
                                                previous_sequence=1, told=1, radius=5000, **own))
        vehicle.wait_for(known=1, map_sequence=3)

    def test_answers_a_poll_yes_with_a_picture_when_the_hazard_is_there(self):
        vehicle = self.driving_vehicle(drive_id="drive-7")
        vehicle.publish("hazard/poll", poll(1, on_street(3.0, 12.0), picture_wanted=True, max_picture_bytes=20000))
        vehicle.wait_for(polls=1)
        vehicle.see(3.05, detection(11.2))
        answer = eventually(lambda: vehicle.received("hazard/poll_answer"), "an answer")[0]
        self.assertEqual((answer.answer, answer.poll_uuid, answer.hazard_uuid),
                         (HazardPollAnswer.YES, bytes([1] * 16), bytes([7] * 16)))
        self.assertEqual((answer.stamp, answer.drive_id, answer.vehicle_id), (stamp(3.05), "drive-7", ""))
        self.assertLess(math.dist(east_north(answer.latitude, answer.longitude), on_street(3.05)), 0.05)
        self.assertLessEqual(len(answer.image.data), 20000)
        self.assertEqual(decode(answer.image).shape, (400, 640, 3))

    def test_a_poll_may_want_only_the_place_and_its_surroundings(self):
        vehicle = self.driving_vehicle()
        vehicle.publish("hazard/poll", poll(1, on_street(3.0, 12.0), picture_wanted=True, max_picture_bytes=20000,
                                            picture_kind=HazardPoll.CROP))
        vehicle.wait_for(polls=1)
        vehicle.see(3.05, detection(11.2))
        answer = eventually(lambda: vehicle.received("hazard/poll_answer"), "an answer")[0]
        self.assertLessEqual(len(answer.image.data), 12000)
        self.assertEqual(decode(answer.image).shape, (320, 480, 3))

    def test_says_when_it_was_too_dark_to_see(self):
        vehicle = self.driving_vehicle(poll_reserve_s=0.5)
        vehicle.publish("hazard/poll", poll(1, on_street(3.0, 12.0), life_s=12))
        vehicle.wait_for(polls=1)
        for tenth in range(26, 38):
            night = camera_image(tenth / 10)
            night.data = bytes(len(night.data))
            vehicle.publish("camera_rect/image", night)
            rospy.sleep(0.2)
            vehicle.publish("hazard/detections", detections(tenth / 10))
        answer = eventually(lambda: vehicle.received("hazard/poll_answer"), "an answer")[0]
        self.assertEqual((answer.answer, answer.reason), (HazardPollAnswer.CANT_SEE, "too dark"))

    def test_keeps_no_image_in_which_nothing_was_found(self):
        vehicle = self.driving_vehicle()
        for tenth in (31, 32):
            vehicle.publish("camera_rect/image", camera_image(tenth / 10))
            vehicle.wait_for(images_kept=1)
            vehicle.publish("hazard/detections", detections(tenth / 10))
            vehicle.wait_for(images_kept=0)

    def test_answers_a_poll_no_when_nothing_was_there_and_cannot_see_without_images(self):
        vehicle = self.driving_vehicle(poll_reserve_s=0.5)
        vehicle.publish("hazard/poll", poll(1, on_street(3.0, 12.0)))
        vehicle.wait_for(polls=1)
        for tenth in range(26, 38):
            vehicle.see(tenth / 10)
        answer = eventually(lambda: vehicle.received("hazard/poll_answer"), "an answer")[0]
        self.assertEqual((answer.answer, answer.reason), (HazardPollAnswer.NO, ""))
        self.assertGreater(answer.confidence, 0.9)
        vehicle.publish("hazard/poll", poll(1, on_street(3.0, 12.0)))
        vehicle.publish("hazard/poll", poll(2, on_street(3.0, 12.0), life_s=2))
        second = eventually(lambda: vehicle.received("hazard/poll_answer")[1:], "another answer")[0]
        self.assertEqual((second.answer, second.poll_uuid), (HazardPollAnswer.CANT_SEE, bytes([2] * 16)))
        self.assertIn(second.reason, ("no image", "the place was out of the camera's view"))
        vehicle.wait_for(polls=3, polls_repeated=1, polls_no=1, polls_cant_see=1)

    def test_what_change_detection_knows_has_a_say_in_an_answer(self):
        vehicle = self.driving_vehicle(poll_reserve_s=0.5)
        gone, came = on_street(3.0, 12.0), on_street(3.0, 12.5, 8.0)
        vehicle.publish("hazard/poll", poll(1, gone, life_s=6, class_name="road_work_sign"))
        vehicle.publish("hazard/poll", poll(2, on_street(3.0, 14.0), life_s=6, class_name="barrier"))
        vehicle.wait_for(polls=2)
        vehicle.publish("change/report", changes(2.9, gone, "sign", ChangedObject.VANISHED))
        vehicle.publish("change/report", changes(2.9, came, "sign", ChangedObject.APPEARED))
        vehicle.see(3.0)
        answers = eventually(lambda: vehicle.received("hazard/poll_answer")[1:] and vehicle.received("hazard/poll_answer"),
                             "both answers")
        told = {answer.poll_uuid[0]: answer for answer in answers}
        self.assertEqual(told[1].answer, HazardPollAnswer.NO, "one clear view, and it is known to have gone")
        self.assertGreaterEqual(told[1].confidence, 0.75)
        self.assertEqual(told[2].answer, HazardPollAnswer.CANT_SEE, "one clear view is not enough")
        vehicle.wait_for(polls_no=1, polls_no_by_change=1, polls_cant_see=1, polls_disagreed=0)

    def test_without_a_fix_holds_back_counts_and_invents_nothing(self):
        vehicle = self.make_vehicle(max_wait_s=2.0)
        vehicle.start()
        vehicle.mount_camera()
        for tenth in range(40):
            vehicle.publish("fix", fix(tenth / 10, NavSatStatus.STATUS_NO_FIX))
        vehicle.see(3.0, detection(12.0))
        vehicle.wait_for(held_back_no_fix=1)
        vehicle.wait_for(held_back_no_fix=1, dropped_no_fix=1, reports_created=0, no_fixes=40)
        self.assertEqual(vehicle.reports(), [])
        self.assertEqual(vehicle.received("vehicle/position"), [])

    def test_holds_a_detection_back_until_fixes_embrace_it(self):
        vehicle = self.make_vehicle(max_wait_s=120.0)
        vehicle.start()
        vehicle.mount_camera()
        vehicle.see(3.0, detection(12.0))
        vehicle.wait_for(held_back_no_fix=1)
        vehicle.drive(0, 4)
        report = eventually(vehicle.reports, "a report")[0]
        self.assertLess(math.dist(east_north(report.latitude, report.longitude),
                                  middle_on_street(3.0, 12.0)), 0.02)
        vehicle.wait_for(dropped_no_fix=0)

    def test_sends_again_until_the_receipt_and_remembers_over_kill_nine(self):
        vehicle = self.driving_vehicle(resend_first_s=0.2, resend_longest_s=0.4)
        vehicle.see(3.0, detection(12.0))
        eventually(lambda: len(vehicle.reports()) >= 3, "the report comes again")
        uuid = bytes(vehicle.reports()[0].uuid)
        vehicle.kill()
        before = len(vehicle.reports())
        vehicle.start()
        eventually(lambda: len(vehicle.reports()) >= before + 2, "it comes after a restart, too")
        self.assertEqual({bytes(report.uuid) for report in vehicle.reports()}, {uuid})
        self.assertEqual(vehicle.reports()[-1].image.data, vehicle.reports()[0].image.data)

        vehicle.publish("hazard/receipt", receipt(vehicle.reports()[0]))
        vehicle.wait_for(committed=1, pending=0, known=1, reports_sent=0)
        count = len(vehicle.reports())
        vehicle.mount_camera()
        vehicle.drive(0, 4)
        vehicle.see(3.5, detection(4.0))
        vehicle.wait_for(duplicates_suppressed=1)
        rospy.sleep(1.0)
        self.assertEqual(len(vehicle.reports()), count, "a finished report is not sent again")

    def test_refused_report_ends_and_says_why(self):
        vehicle = self.driving_vehicle()
        vehicle.see(3.0, detection(12.0))
        answer = receipt(eventually(vehicle.reports, "a report")[0], ReportReceipt.REFUSED)
        answer.reason = "outside of the zone"
        vehicle.publish("hazard/receipt", answer)
        vehicle.wait_for(refused=1, committed=0, pending=0)
        eventually(lambda: "outside of the zone" in vehicle.output(), "the reason in the log")

    def test_paused_simulated_clock_does_not_stop_the_delivery(self):
        rospy.set_param("/use_sim_time", True)
        self.addCleanup(rospy.set_param, "/use_sim_time", False)
        clock = rospy.Publisher("/clock", Clock, queue_size=1, latch=True)
        self.addCleanup(clock.unregister)
        clock.publish(Clock(stamp(4.0)))
        vehicle = self.driving_vehicle(resend_first_s=0.2, resend_longest_s=0.4)
        vehicle.see(3.05, detection(12.0))
        eventually(lambda: len(vehicle.reports()) >= 4, "the report comes again")
        vehicle.publish("hazard/receipt", receipt(vehicle.reports()[0]))
        vehicle.wait_for(committed=1, pending=0)

    def test_corrupt_memory_is_set_aside_loudly(self):
        vehicle = self.driving_vehicle()
        vehicle.see(3.0, detection(12.0))
        vehicle.wait_for(pending=1)
        vehicle.kill()
        # The log, too: from an intact one SQLite would mend the rest.
        for suffix in ["", "-wal"]:
            with open(vehicle.database + suffix, "r+b") as file:
                file.write(b"X" * 2000)
        vehicle.start()
        vehicle.wait_for(pending=0, known=0)
        self.assertEqual(len(glob.glob(vehicle.database + ".corrupt-*[0-9]")), 1)
        self.assertIn("was corrupt", vehicle.output())

    def test_wrong_parameters_are_one_sentence_and_a_failed_load(self):
        for parameters, sentence in [
                ({"max_rang_m": 3.0}, "unknown parameter '/{}/hazard_reporting/max_rang_m'"),
                ({"max_range_m": -3.0}, "max_range_m' is -3, accepted is a number from 0.1"),
                ({"catalogue": "/nowhere.yaml"}, "cannot read file '/nowhere.yaml'"),
                ({"privacy_finder": "cascades", "privacy_cascades": "/nowhere"}, "cascade '/nowhere/"),
                ({"pictures_on_demand": False}, "pictures_on_demand' is no longer accepted: hazard_reporting makes every"),
                ({"map_datum": "here"}, "parameter 'map_datum' is 'here'")]:
            vehicle = self.make_vehicle(**parameters)
            vehicle.start(wait=False)
            sentence = sentence.format(vehicle.name)
            try:
                eventually(lambda: sentence in vehicle.output(), sentence)
            except AssertionError as error:
                raise AssertionError(f"{error}, it said: {vehicle.output()}") from None


if __name__ == "__main__":
    rospy.init_node("hazard_reporting_test")
    rostest.rosrun("livemap", "hazard_reporting", HazardReportingTest, sys.argv)
