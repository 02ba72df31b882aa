#!/usr/bin/python3
"""The command-line programs of the detector, on a drive made of coloured blocks.

    detection_tools_test.py FOLDER_OF_THE_PROGRAMS

The model is the tiny one of test/perception/inference/make_tiny_model.py: a red block is a pothole.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

import cv2
import numpy

SOURCE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.realpath(__file__))))
MODEL = os.path.join(SOURCE, "test", "perception", "inference", "tiny.yaml")
PROGRAMS = sys.argv.pop()
WIDTH, HEIGHT = 64, 48


def run(program, *arguments):
    return subprocess.run([os.path.join(PROGRAMS, program), *arguments], capture_output=True,
                          text=True, timeout=120, check=False)


def write_frame(folder, name, red_blocks, labels):
    """An image with red cells (column, row), and boxes x y width height in pixels as its labels."""
    pixels = numpy.zeros((HEIGHT, WIDTH, 3), numpy.uint8)
    for column, row in red_blocks:
        pixels[8 * row:8 * row + 8, 8 * column:8 * column + 8] = (0, 0, 255)
    cv2.imwrite(os.path.join(folder, "images", name + ".png"), pixels)
    with open(os.path.join(folder, "labels", name + ".txt"), "w", encoding="ascii") as file:
        for x, y, width, height in labels:
            file.write(f"0 {(x + width / 2) / WIDTH} {(y + height / 2) / HEIGHT} "
                       f"{width / WIDTH} {height / HEIGHT}\n")


class DetectionToolsTest(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.addCleanup(self.temporary.cleanup)
        self.drive = os.path.join(self.temporary.name, "drive")
        for part in ("images", "labels"):
            os.makedirs(os.path.join(self.drive, part))
        # The cell (2, 1) answers with the box 12 8 16 8.
        write_frame(self.drive, "a", [(2, 1)], [(12, 8, 16, 8)])  # found
        write_frame(self.drive, "b", [], [(12, 8, 16, 8)])  # missed, the same event
        write_frame(self.drive, "c", [], [(40, 24, 8, 8)])  # another event, missed
        write_frame(self.drive, "d", [(2, 1)], [])  # a false report
        with open(os.path.join(self.drive, "frames.csv"), "w", encoding="ascii") as file:
            file.write("frame,chainage_m,potholes\na,0,1\nb,10,1\nc,30,1\nd,40,0\n")

    def test_a_drives_figures_are_those_of_the_definitions(self):
        done = run("livemap_evaluate_detection", "--json", "--model", MODEL, self.drive)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stdout.count("\n"), 1)
        result = json.loads(done.stdout)
        self.assertEqual(result["frames"], 4)
        self.assertEqual(list(result["classes"]), ["pothole"], "cones are not labelled there")
        pothole = result["classes"]["pothole"]
        self.assertEqual((pothole["labels"], pothole["events"], pothole["n"]), (3, 2, 4))
        self.assertAlmostEqual(pothole["precision"], 0.5)
        self.assertAlmostEqual(pothole["recall"], 1 / 3)
        self.assertAlmostEqual(pothole["event_recall"], 0.5)
        self.assertAlmostEqual(pothole["event_recall_iou30"], 0.5)
        self.assertAlmostEqual(pothole["km"], 0.032)
        self.assertAlmostEqual(pothole["false_per_km"], 1 / 0.032)
        self.assertGreater(pothole["ap50"], 0.3)
        self.assertGreater(result["inference_ms_p50"], 0)

    def write_detections(self, *lines):
        path = os.path.join(self.temporary.name, "found.csv")
        with open(path, "w", encoding="ascii") as file:
            file.write("\n".join(("image,class,score,x_min,y_min,x_max,y_max",) + lines) + "\n")
        return path

    def test_listed_detections_have_the_figures_of_a_model_that_finds_them(self):
        model = run("livemap_evaluate_detection", "--json", "--model", MODEL, self.drive)
        found = self.write_detections("a,pothole,0.9,12,8,28,16", "d.png,pothole,0.9,12,8,28,16", "a,traffic_cone,0.9,0,0,9,9")
        done = run("livemap_evaluate_detection", "--json", "--model", MODEL, "--detections", found, self.drive)
        self.assertEqual(done.returncode, 0, done.stderr)
        told, expected = json.loads(done.stdout), json.loads(model.stdout)
        for key in ("labels", "events", "event_recall", "false_detections", "false_reports", "km", "ap50"):
            self.assertEqual(told["classes"]["pothole"][key], expected["classes"]["pothole"][key], key)
        self.assertEqual(told["model"], found)
        self.assertIsNone(told["inference_ms_p50"], "nothing ran")

    def test_of_listed_detections_all_count_and_none_may_be_of_another_picture(self):
        unsure = self.write_detections("c,pothole,0,40,24,48,32")
        done = run("livemap_evaluate_detection", "--json", "--model", MODEL, "--detections", unsure, self.drive)
        self.assertEqual(json.loads(done.stdout)["classes"]["pothole"]["event_recall"], 0.5, done.stderr)
        elsewhere = self.write_detections("e,pothole,1,40,24,48,32")
        for arguments, sentence in (((elsewhere, self.drive), "names the picture 'e', which is not among those of"),
                                    ((elsewhere, self.drive, self.drive), "--detections is about one DIR, given are 2"),
                                    ((elsewhere, "--threads", "1", self.drive), "--threads is about a run of the model")):
            done = run("livemap_evaluate_detection", "--model", MODEL, "--detections", *arguments)
            self.assertNotEqual(done.returncode, 0)
            self.assertIn(sentence, done.stderr)

    def test_listed_detections_of_an_unknown_class_and_beside_the_picture_are_refused(self):
        for line, sentence in (("a,potholes,1,12,8,28,16", "line 2 of '{}' has the class 'potholes', accepted are pothole"),
                               ("a,pothole,1,64,8,80,16", "the box 64,8,80,16, accepted are boxes that overlap its 64x48 px")):
            found = self.write_detections(line)
            done = run("livemap_evaluate_detection", "--model", MODEL, "--detections", found, self.drive)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn(sentence.format(found), done.stderr)

    def test_two_label_numbers_of_one_class_count_each_frame_once(self):
        once, twice = (json.loads(run("livemap_evaluate_detection", "--json", "--model", MODEL, "--label-classes", names,
                                      self.drive).stdout)["classes"]["pothole"] for names in ("pothole", "pothole,pothole"))
        self.assertEqual(once, twice)

    def test_counts_that_differ_from_the_label_files_are_told(self):
        with open(os.path.join(self.drive, "frames.csv"), "a", encoding="ascii") as file:
            file.write("e,50,2\n")
        write_frame(self.drive, "e", [], [(12, 8, 16, 8)])
        done = run("livemap_evaluate_detection", "--json", "--model", MODEL, self.drive)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("counts other potholes than the label files in 1 frame, the first is 'e'", done.stderr)

    def test_masked_photos_never_take_the_place_of_the_photos(self):
        photo = os.path.join(self.temporary.name, "photo.jpg")
        cv2.imwrite(photo, numpy.full((HEIGHT, WIDTH, 3), 100, numpy.uint8))
        with open(photo, "rb") as file:
            before = file.read()
        done = run("livemap_evaluate_privacy", "--model", MODEL, "--output", self.temporary.name + "/", photo)
        self.assertEqual((done.returncode, done.stdout), (2, ""), done.stderr)
        self.assertIn("accepted is a folder without the files that are read", done.stderr)
        with open(photo, "rb") as file:
            self.assertEqual(file.read(), before)

    def test_labelled_faces_that_no_mask_covers_are_missed_and_unclear_ones_are_not(self):
        photo = os.path.join(self.temporary.name, "photo.png")
        cv2.imwrite(photo, numpy.full((HEIGHT, WIDTH, 3), 100, numpy.uint8))
        labels = os.path.join(self.temporary.name, "labels.txt")
        with open(labels, "w", encoding="ascii") as file:
            file.write("# who\nphoto.png face 2 2 20 20\nphoto.png plate 30 2 8 4\nphoto.png unclear 40 2 8 8\n"
                       "other_photo.png face 2 2 20 20\n")
        arguments = ("livemap_evaluate_privacy", "--model", MODEL, "--finder", "cascades", "--labels", labels)
        done = run(*arguments, photo)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("0 of 1 labelled faces and 0 of 1 labelled plates are masked, 0 masks touch no label, 0 of them "
                      "sure\n", done.stdout)
        self.assertIn("cascades looked for faces and plates, ", done.stdout)
        with open(labels, "a", encoding="ascii") as file:
            file.write("photo.png nose 2 2 20 20\n")
        done = run(*arguments, photo)
        self.assertEqual((done.returncode, done.stdout), (2, ""), done.stderr)
        self.assertIn("labels.txt' line 6 is 'photo.png nose 2 2 20 20', accepted is PHOTO face|plate|unclear X Y WIDTH "
                      "HEIGHT", done.stderr)

    def test_a_finder_that_is_none_is_refused(self):
        done = run("livemap_evaluate_privacy", "--model", MODEL, "--finder", "eyes", "photo.png")
        self.assertEqual((done.returncode, done.stdout), (2, ""), done.stderr)
        self.assertIn("--finder is 'eyes', accepted are auto, networks, cascades", done.stderr)

    def test_photos_without_a_label_are_null_with_a_reason_and_exit_1(self):
        os.remove(os.path.join(self.drive, "frames.csv"))
        for name in "abcd":
            open(os.path.join(self.drive, "labels", name + ".txt"), "w", encoding="ascii").close()
        done = run("livemap_evaluate_detection", "--json", "--label-classes", "pothole", "--model", MODEL, self.drive)
        self.assertEqual(done.returncode, 1, done.stderr)
        result = json.loads(done.stdout)
        pothole = result["classes"]["pothole"]
        for key in ("ap50", "ap30", "recall", "event_recall", "false_per_km"):
            self.assertIsNone(pothole[key], key)
        self.assertIn("4 frames have no label", result["reason"])
        self.assertIn(result["reason"], done.stderr)

    def test_pictures_are_turned_as_their_exif_says(self):
        upright = numpy.zeros((HEIGHT, WIDTH, 3), numpy.uint8)
        upright[8:16, 16:24] = (0, 0, 255)
        exif = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0"
        _, stored = cv2.imencode(".jpg", numpy.rot90(upright), [cv2.IMWRITE_JPEG_QUALITY, 100])
        stored = stored.tobytes()
        segment = b"\xff\xe1" + (8 + len(exif)).to_bytes(2, "big") + b"Exif\0\0" + exif
        path = os.path.join(self.temporary.name, "phone.jpg")
        with open(path, "wb") as file:
            file.write(stored[:2] + segment + stored[2:])
        plain = os.path.join(self.temporary.name, "plain.jpg")
        cv2.imwrite(plain, upright, [cv2.IMWRITE_JPEG_QUALITY, 100])
        found, wanted = (json.loads(run("livemap_detect_image", "--model", MODEL, each).stdout) for each in (path, plain))
        self.assertEqual((found["width"], found["height"]), (WIDTH, HEIGHT))
        self.assertEqual(len(found["detections"]), 1)
        self.assertEqual(found["detections"][0]["box"], wanted["detections"][0]["box"])

    def test_errors_are_listed_by_cause_and_shown(self):
        folder = os.path.join(self.temporary.name, "errors")
        done = run("livemap_evaluate_detection", "--json", "--model", MODEL, "--errors", folder, self.drive)
        self.assertEqual(done.returncode, 0, done.stderr)
        pothole = json.loads(done.stdout)["classes"]["pothole"]
        self.assertEqual((pothole["missed_by_cause"], pothole["false_by_cause"]), ({"unseen": 1}, {"background": 1}))
        with open(os.path.join(folder, "errors.csv"), encoding="ascii") as file:
            rows = [line.split(",") for line in file.read().splitlines()]
        self.assertEqual([row[:3] for row in rows[1:]], [["pothole", "missed", "unseen"], ["pothole", "false", "background"]])
        self.assertEqual([os.path.basename(row[-1]) for row in rows[1:]], ["c.png", "d.png"])
        for kind in ("missed", "false"):
            sheet = cv2.imread(os.path.join(folder, f"pothole_{kind}.jpg"))
            self.assertGreater(sheet.std(), 10)
        self.assertIn(f"errors: {folder}/errors.csv", done.stderr)
        again = run("livemap_evaluate_detection", "--model", MODEL, "--errors", folder, self.drive)
        self.assertEqual(again.returncode, 2)
        self.assertIn("accepted is a new folder", again.stderr)

    def test_folders_are_pooled_and_the_table_names_the_class(self):
        same = os.path.join(self.temporary.name, "same")
        shutil.copytree(self.drive, same)
        done = run("livemap_evaluate_detection", "--sweep", "--model", MODEL, self.drive, same)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("8 frames", done.stdout)
        self.assertIn("pothole", done.stdout)

    def test_mistakes_are_one_sentence_and_exit_2(self):
        stills = os.path.join(self.temporary.name, "stills")
        shutil.copytree(self.drive, stills, ignore=shutil.ignore_patterns("frames.csv"))
        for arguments, expected in [
                ([], "got 0 arguments"), (["--bogus", self.drive], "--bogus"),
                (["/nowhere"], "/nowhere"), (["--threads", "0", self.drive], "--threads"),
                (["--lowest-score", "nan", self.drive], "nan"),
                (["--model", "/nowhere.yaml", self.drive], "/nowhere.yaml"),
                (["--model", MODEL, "--label-classes", "deer", self.drive], "deer"),
                (["--model", MODEL, self.drive, self.drive + "/"], "given twice"),
                (["--model", MODEL, "--split", "val", self.drive], "is not divided"),
                (["--repeat-gain", "0.5", self.drive], "--repeat-gain needs --tracking"),
                (["--model", MODEL, "--label-classes", "pothole", "--errors", os.path.join(self.temporary.name, "new"), stills],
                 "--errors needs a drive"),
                (["--threads", "1.5", self.drive], "--threads")]:
            done = run("livemap_evaluate_detection", *arguments)
            self.assertEqual(done.returncode, 2, arguments)
            self.assertEqual(done.stdout, "", arguments)
            self.assertEqual(done.stderr.strip().count("\n"), 0, done.stderr)
            self.assertIn(expected, done.stderr)

    def test_one_images_detections_are_printed_and_drawn(self):
        image = os.path.join(self.drive, "images", "a.png")
        drawn = os.path.join(self.temporary.name, "drawn.png")
        done = run("livemap_detect_image", "--model", MODEL, "--draw", drawn, image)
        self.assertEqual(done.returncode, 0, done.stderr)
        result = json.loads(done.stdout)
        self.assertEqual((result["width"], result["height"]), (WIDTH, HEIGHT))
        self.assertEqual([found["class"] for found in result["detections"]], ["pothole"])
        for edge, expected in zip(result["detections"][0]["box"], (12, 8, 28, 16)):
            self.assertAlmostEqual(edge, expected, delta=0.1)
        self.assertGreater(numpy.abs(cv2.imread(drawn).astype(int) - cv2.imread(image)).sum(), 0)
        self.assertEqual(run("livemap_detect_image", "--model", MODEL, MODEL).returncode, 2)
        for arguments, expected in [(["--draw", "/nowhere/x.png", image], "folder does not exist"),
                                    (["--draw", drawn + ".gif", image], "ending in .jpg or .png"), ([self.drive], "is a folder")]:
            refused = run("livemap_detect_image", "--model", MODEL, *arguments)
            self.assertEqual((refused.returncode, refused.stdout), (2, ""))
            self.assertIn(expected, refused.stderr)

    def test_both_have_help(self):
        for program in ("livemap_evaluate_detection", "livemap_detect_image"):
            done = run(program, "--help")
            self.assertEqual((done.returncode, done.stderr), (0, ""))
            self.assertIn("usage: " + program, done.stdout)


if __name__ == "__main__":
    unittest.main()
