#!/usr/bin/python3
"""gps_receiver as a vehicle runs it: a real gpsd, fed by gpsfake and its library with sentences made here."""

import math
import os
import re
import signal
import sys
import tempfile
import threading
import time
import unittest

import gps.fake
import numpy
import rospy
import rostest
from geometry_msgs.msg import TwistWithCovarianceStamped
from sensor_msgs.msg import NavSatFix, NavSatStatus

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "support"))
from node_testing import SOURCE_DIRECTORY, NodeletUnderTest, eventually, parameters_of, start_child  # noqa: E402

sys.path.insert(0, os.path.join(SOURCE_DIRECTORY, "scripts", "lib"))
from listening_port import free_port  # noqa: E402

LATITUDE, LONGITUDE, HEIGHT_M, GEOID_M = -27.6, -48.5, 12.0, 3.0
START_S = float(int(time.time()))
# The receiver drives north-east so fast.
SPEED_MPS, COURSE_DEG, DEGREES_PER_S = 10.0, 45.0, 1e-4
UNKNOWN = 1e6
PERIOD_S = 0.25
# gpsd makes an error of 95 % in the plane, and upwards, of these.
HDOP, VDOP, UERE_M, VERTICAL_UERE_M = 0.9, 1.5, 19.0, 23.0


def position_at(seconds):
    """Where the receiver is; exact in sentences, whose minutes have seven digits."""
    along = DEGREES_PER_S * (seconds - START_S)
    return LATITUDE + along, LONGITUDE + along


def sentence(text):
    checksum = 0
    for character in text:
        checksum ^= ord(character)
    return f"${text}*{checksum:02X}\r\n".encode()


def degrees_minutes(degrees, digits):
    whole = int(abs(degrees))
    return f"{whole:0{digits}d}{60 * (abs(degrees) - whole):010.7f}"


def time_fields(seconds):
    hundredths = round(100 * seconds)
    moment = time.gmtime(hundredths // 100)
    return time.strftime("%H%M%S", moment) + f".{hundredths % 100:02d}", time.strftime("%d%m%y", moment)


def drive(seconds, aside_deg=0.0, north=None):
    """What a receiver says of one moment, `aside_deg` further north than it is."""
    clock, date = time_fields(seconds)
    latitude, longitude = position_at(round(seconds, 2))
    latitude = latitude + aside_deg if north is None else north
    place = (f"{degrees_minutes(latitude, 2)},{'NS'[latitude < 0]},"
             f"{degrees_minutes(longitude, 3)},{'EW'[longitude < 0]}")
    return [sentence(f"GPRMC,{clock},A,{place},{SPEED_MPS * 3600 / 1852:.4f},{COURSE_DEG:.1f},{date},,,A"),
            sentence(f"GPGGA,{clock},{place},1,08,{HDOP},{HEIGHT_M},M,{GEOID_M},M,,"),
            sentence(f"GPGSA,A,3,01,02,03,04,05,06,07,08,,,,,1.8,{HDOP},{VDOP}")]


def drive_below_satellites(seconds):
    """The same with the satellites, of which gpsd makes an error of each axis, and of the speed."""
    return drive(seconds) + [sentence("GPGSV,2,1,08,01,60,045,40,02,30,090,38,03,45,135,42,04,20,200,35"),
                             sentence("GPGSV,2,2,08,05,70,250,44,06,15,300,33,07,40,330,41,08,25,010,37")]


def without_fix(seconds):
    clock, date = time_fields(seconds)
    return [sentence(f"GPRMC,{clock},V,,,,,,,{date},,,N"), sentence(f"GPGGA,{clock},,,,,0,00,99.9,,,,,,"),
            sentence("GPGSA,A,1,,,,,,,,,,,,,99.9,99.9,99.9")]


def broken(lines):
    """The same with each checksum wrong."""
    return [line[:-4] + f"{int(line[-4:-2], 16) ^ 1:02X}\r\n".encode() for line in lines]


class Gpsd:
    """A gpsd on a port of its own, without a receiver at first."""

    def __init__(self):
        self.port = free_port()
        self.folder = tempfile.TemporaryDirectory(prefix="livemap_gpsd_")
        self.socket = os.path.join(self.folder.name, "control")
        self.process = None

    def start(self):
        if os.path.exists(self.socket):
            os.unlink(self.socket)
        environment = dict(os.environ, GPSD_SHM_KEY=f"0x4770{self.port:04X}", PATH=os.environ["PATH"] + ":/usr/sbin")
        self.process = start_child(["gpsd", "-n", "-b", "-N", "-S", str(self.port), "-F", self.socket],
                                   env=environment)
        eventually(lambda: os.path.exists(self.socket), "gpsd has started")

    def control(self):
        return gps.fake.DaemonInstance(self.socket)

    def stop(self):
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process = None

    def close(self):
        self.stop()
        self.folder.cleanup()


class Receiver:
    """gpsfake's pseudo-terminal, on which a thread says what `speak` makes of the time."""

    class Load:
        name, serial, delay, sentences = "receiver", None, 0, ()

    def __init__(self, gpsd, speak=drive):
        self.gpsd, self.speak = gpsd, speak
        self.plugged = True
        self.pty = gps.fake.FakePTY(self.Load, speed=9600)
        # Where nobody reads, what it says is lost.
        os.set_blocking(self.pty.fd, False)
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()
        self.plug_in()

    def plug_in(self):
        self.gpsd.control().add_device(self.pty.byname)

    def run(self):
        while self.plugged:
            for line in self.speak(time.time()):
                try:
                    self.pty.write(line)
                except BlockingIOError:
                    pass
            time.sleep(PERIOD_S)

    def unplug(self):
        if not self.plugged:
            return
        self.plugged = False
        self.thread.join()
        if self.gpsd.process is not None:
            self.gpsd.control().remove_device(self.pty.byname)
        os.close(self.pty.fd)
        os.close(self.pty.slave_fd)


class Vehicle(NodeletUnderTest):
    def __init__(self, name, **parameters):
        super().__init__(name, "gps_receiver")
        self.ends_heard = [self.subscribe("fix", NavSatFix), self.subscribe("gps/velocity", TwistWithCovarianceStamped)]
        rospy.set_param(f"/{name}/gps_receiver",
                        dict(parameters_of("gps_receiver"), diagnostics_period_s=0.1, reconnect_max_s=1.0, **parameters))
        self.start_nodelet("gps_receiver", "standalone", "livemap/GpsReceiverNodelet")
        eventually(lambda: all(end.get_num_connections() > 0 for end in self.ends_heard), "it speaks")

    def fixes(self):
        return [message for message in self.received("fix") if message.status.status != NavSatStatus.STATUS_NO_FIX]

    def wait_for_fixes(self, count):
        """So many more than there are."""
        wanted = len(self.fixes()) + count
        return eventually(lambda: len(self.fixes()) >= wanted and self.fixes(), f"{count} more fixes")

    def wait_for_words(self, pattern):
        """In the log."""
        return eventually(lambda: re.search(pattern, self.output()), f"the log says '{pattern}'")

    def counter(self, name):
        return int(self.diagnostics().get(name, 0))


class GpsReceiverTest(unittest.TestCase):
    number = 0

    def setUp(self):
        self.gpsd = Gpsd()
        self.addCleanup(self.gpsd.close)

    def vehicle(self, **parameters):
        GpsReceiverTest.number += 1
        vehicle = Vehicle(f"vehicle{GpsReceiverTest.number}", port=self.gpsd.port, **parameters)
        self.addCleanup(vehicle.stop)
        return vehicle

    def receiver(self, speak=drive):
        receiver = Receiver(self.gpsd, speak)
        self.addCleanup(receiver.unplug)
        return receiver

    def driving(self, **parameters):
        """A vehicle that has its first fixes, and its receiver."""
        self.gpsd.start()
        receiver = self.receiver()
        vehicle = self.vehicle(**parameters)
        vehicle.wait_for_fixes(3)
        vehicle.wait_for(state="fix")
        return vehicle, receiver

    def assert_true(self, message, what="", aside_deg=0.0):
        latitude, longitude = position_at(message.header.stamp.to_sec())
        self.assertAlmostEqual(message.latitude, latitude + aside_deg, delta=1e-6, msg=what)
        self.assertAlmostEqual(message.longitude, longitude, delta=1e-6, msg=what)

    def test_fixes_and_velocities_are_those_of_the_receiver_at_its_time(self):
        vehicle, receiver = self.driving()
        # gpsd learns with the first moments where a moment ends.
        begun = len(vehicle.fixes())
        fixes = vehicle.wait_for_fixes(20)[begun + 5:]
        for message in fixes:
            self.assert_true(message)
            self.assertTrue(START_S <= message.header.stamp.to_sec() <= time.time())
            self.assertEqual((message.header.frame_id, message.status.status), ("gps", NavSatStatus.STATUS_FIX))
            self.assertAlmostEqual(message.altitude, HEIGHT_M + GEOID_M, delta=0.01)
            covariance = numpy.reshape(message.position_covariance, (3, 3))
            wanted = [(HDOP * UERE_M / 2.448) ** 2] * 2 + [(VDOP * VERTICAL_UERE_M / 1.96) ** 2]
            numpy.testing.assert_allclose(covariance, numpy.diag(wanted), rtol=1e-3)
            self.assertEqual(message.position_covariance_type, NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN)
        stamps = [message.header.stamp for message in vehicle.fixes()]
        self.assertEqual(stamps, sorted(set(stamps)), "each moment once, in order")
        velocities = eventually(lambda: vehicle.received("gps/velocity")[5:], "velocities")
        self.assertLessEqual({message.header.stamp for message in velocities}, set(stamps))
        for message in velocities:
            linear = message.twist.twist.linear
            along = SPEED_MPS * math.sqrt(0.5)
            numpy.testing.assert_allclose((linear.x, linear.y), (along, along), atol=0.01)
            covariance = numpy.reshape(message.twist.covariance, (6, 6))
            self.assertGreater(numpy.linalg.eigvalsh(covariance).min(), 0)
            # gpsd states no error of the speed here.
            self.assertEqual(list(numpy.diag(covariance)[[0, 1, 3, 4, 5]]), [UNKNOWN] * 5)
        vehicle.wait_for(state="fix", device=receiver.pty.byname, reports_refused=0)
        self.assertLess(abs(float(vehicle.diagnostics()["clock_offset_s"])), 2)

    def test_known_satellites_give_an_error_of_each_axis_and_of_the_speed(self):
        vehicle, receiver = self.driving()
        receiver.speak = drive_below_satellites
        known = eventually(lambda: [m for m in vehicle.fixes() if m.position_covariance[0] != m.position_covariance[4]],
                           "errors of each axis")[-1]
        for variance in (known.position_covariance[0], known.position_covariance[4]):
            self.assertGreater(variance, 1.0)
            self.assertLess(variance, 100.0)
        by_gpsd = eventually(lambda: [m for m in vehicle.received("gps/velocity") if m.twist.covariance[0] < UNKNOWN],
                             "an error of the speed")[-1]
        self.assertGreater(by_gpsd.twist.covariance[0], 100.0, "gpsd's estimate, of two positions, is far too large")
        vehicle.wait_for(satellites_used=8, satellites_visible=8)
        told = self.vehicle(velocity_sigma_mps=0.25)
        by_data_sheet = eventually(lambda: told.received("gps/velocity"), "velocities")[-1]
        self.assertAlmostEqual(by_data_sheet.twist.covariance[0], 0.0625)

    def test_a_receiver_without_a_fix_is_said_and_comes_back(self):
        vehicle, receiver = self.driving()
        receiver.speak = without_fix
        vehicle.wait_for(state="no fix")
        told = eventually(lambda: [m for m in vehicle.received("fix")
                                   if m.status.status == NavSatStatus.STATUS_NO_FIX], "it says so on the topic")[-1]
        self.assertTrue(math.isnan(told.latitude) and math.isnan(told.longitude))
        self.assertEqual(told.position_covariance_type, NavSatFix.COVARIANCE_TYPE_UNKNOWN)
        vehicle.wait_for_words("no fix: ")
        receiver.speak = drive
        self.assert_true(vehicle.wait_for_fixes(3)[-1])
        vehicle.wait_for(state="fix")

    def test_jumps_are_counted_and_left_to_those_who_know_the_track(self):
        vehicle, receiver = self.driving()
        self.assertEqual(vehicle.counter("jumps"), 0)
        receiver.speak = lambda seconds: drive(seconds, aside_deg=0.1)
        eventually(lambda: vehicle.fixes()[-1].latitude > position_at(time.time())[0] + 0.05, "the jump is published")
        receiver.speak = drive
        eventually(lambda: vehicle.fixes()[-1].latitude < position_at(time.time())[0] + 0.05, "it is back")
        vehicle.wait_for(state="fix", jumps=2)
        self.assert_true(vehicle.wait_for_fixes(3)[-1])

    def test_a_place_where_receivers_without_a_position_put_it_is_refused(self):
        vehicle, receiver = self.driving()
        receiver.speak = lambda seconds: [line for line in [
            sentence(f"GPRMC,{time_fields(seconds)[0]},A,0000.00000,N,00000.00000,E,0.0,0.0,{time_fields(seconds)[1]},,,A")]]
        eventually(lambda: vehicle.counter("reports_refused") > 0, "it is refused")
        self.assertTrue(all(abs(message.latitude) > 1 for message in vehicle.fixes()))
        vehicle.wait_for(state="no fix")
        receiver.speak = drive
        vehicle.wait_for_fixes(1)

    def test_broken_checksums_give_no_position_and_silence_is_said(self):
        vehicle, receiver = self.driving(silence_s=2.0)
        # Every second one broken, and what is broken says another place.
        turn = [0]

        def half_broken(seconds):
            turn[0] += 1
            return broken(drive(seconds, aside_deg=1.0)) if turn[0] % 2 else drive(seconds)

        receiver.speak = half_broken
        for message in vehicle.wait_for_fixes(6):
            self.assert_true(message, "no broken sentence came through")
        receiver.speak = lambda seconds: broken(drive(seconds))
        vehicle.wait_for(state="receiver silent")
        vehicle.wait_for_words("receiver silent: ")
        receiver.speak = drive
        self.assert_true(vehicle.wait_for_fixes(3)[-1])
        vehicle.wait_for(state="fix")

    def test_a_receiver_that_is_unplugged_is_missed_and_found_again(self):
        self.gpsd.start()
        vehicle = self.vehicle()
        vehicle.wait_for(state="no receiver")
        vehicle.wait_for_words("no receiver: ")
        receiver = self.receiver()
        vehicle.wait_for_fixes(3)
        receiver.unplug()
        vehicle.wait_for(state="no receiver", device="")
        receiver = self.receiver()
        self.assert_true(vehicle.wait_for_fixes(3)[-1])
        vehicle.wait_for(state="fix", device=receiver.pty.byname)

    def test_only_the_receiver_that_is_asked_for_counts(self):
        self.gpsd.start()
        self.receiver()
        vehicle = self.vehicle(device="/dev/livemap_no_such_receiver")
        vehicle.wait_for(state="no receiver", fixes=0)
        self.assertEqual(vehicle.received("fix"), [])

    def test_a_gpsd_that_is_killed_is_missed_and_found_again(self):
        vehicle, receiver = self.driving()
        self.gpsd.stop()
        vehicle.wait_for(state="no gpsd")
        vehicle.wait_for_words("no gpsd: ")
        self.gpsd.start()
        receiver.plug_in()
        self.assert_true(vehicle.wait_for_fixes(3)[-1])
        vehicle.wait_for(state="fix")
        self.assertGreater(vehicle.counter("connections"), 1)

    def test_a_gpsd_that_hangs_is_found_out(self):
        vehicle, _ = self.driving(silence_s=1.0, connect_timeout_s=1.0)
        self.gpsd.process.send_signal(signal.SIGSTOP)
        vehicle.wait_for(state="no gpsd")
        self.gpsd.process.send_signal(signal.SIGCONT)
        self.assert_true(vehicle.wait_for_fixes(3)[-1])
        vehicle.wait_for(state="fix")

    def test_fixes_are_withheld_while_the_clocks_are_apart(self):
        self.gpsd.start()
        receiver = self.receiver(lambda seconds: drive(seconds - 100))
        vehicle = self.vehicle()
        vehicle.wait_for(state="clock wrong")
        eventually(lambda: vehicle.counter("fixes_withheld") > 3, "fixes are withheld")
        self.assertEqual(vehicle.fixes(), [])
        vehicle.wait_for_words(r"clock wrong: this computer's clock is 1\d\d\.\d s ahead of the receiver's")
        receiver.speak = drive
        self.assert_true(vehicle.wait_for_fixes(3)[-1])
        vehicle.wait_for(state="fix")

    def test_a_log_that_gpsfake_plays_gives_its_positions(self):
        log = os.path.join(self.gpsd.folder.name, "drive.nmea")
        begin = float(int(time.time())) - 60
        with open(log, "wb") as file:
            for i in range(60):
                file.writelines(drive(begin + i))
        # Its clock is that of the log.
        vehicle = self.vehicle(max_clock_offset_s=100000.0)
        played = start_child(["gpsfake", "-n", "-q", "-c", "0.05", "-P", str(self.gpsd.port), log],
                             env=dict(os.environ, TMPDIR=self.gpsd.folder.name, PATH=os.environ["PATH"] + ":/usr/sbin"),
                             start_new_session=True)
        self.addCleanup(self.end_group, played)
        for message in vehicle.wait_for_fixes(20):
            self.assert_true(message)

    @staticmethod
    def end_group(process):
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


if __name__ == "__main__":
    rospy.init_node("gps_receiver_test")
    rostest.rosrun("livemap", "gps_receiver_test", GpsReceiverTest, sys.argv)
