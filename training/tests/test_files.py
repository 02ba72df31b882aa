"""Folders of pictures and files of text as users have them."""

import tempfile
import unittest
from pathlib import Path

import cv2
import numpy as np

from common.files import DataError, PictureFolder, list_pictures, natural_key, read_text
from common.figures import mean, share, text
from detector.data import POTHOLE, read_drive, read_folder


class Folder(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.root = Path(temporary.name)

    def touch(self, *names):
        for name in names:
            (self.root / name).touch()

    def names(self):
        return [path.name for path in list_pictures(self.root)]


class Pictures(Folder):
    def test_numbers_are_in_number_order_whatever_the_extension_and_its_case(self):
        self.touch("10.jpeg", "2.JPG", "1.png", "100.JPEG", "notes.txt", "._1.png", ".hidden.jpg")
        self.assertEqual(self.names(), ["1.png", "2.JPG", "10.jpeg", "100.JPEG"])
        self.assertLess(natural_key("img-9"), natural_key("img-10"))

    def test_two_with_one_name_and_what_would_be_passed_over_are_refused(self):
        self.touch("a.png", "a.JPG")
        with self.assertRaisesRegex(DataError, "a.JPG and .*a.png have one name"):
            list_pictures(self.root)
        (self.root / "a.JPG").rename(self.root / "b.BMP")
        with self.assertRaisesRegex(DataError, "b.BMP would be passed over"):
            list_pictures(self.root)
        (self.root / "b.BMP").unlink()
        (self.root / "c.png").symlink_to(self.root / "nothing")
        with self.assertRaisesRegex(DataError, "c.png is a link"):
            list_pictures(self.root)

    def test_a_number_is_found_however_it_is_padded(self):
        self.touch("1_07.png", "1_8.png", "008.jpg", "08.jpg")
        folder = PictureFolder(self.root)
        self.assertEqual(folder.find("1_7").name, "1_07.png")
        self.assertEqual(folder.find("1_008").name, "1_8.png")
        self.assertEqual(folder.find("08").name, "08.jpg")
        self.assertIsNone(folder.find("9"))
        with self.assertRaisesRegex(DataError, "one number"):
            folder.find("8")


class Texts(Folder):
    def test_marks_and_line_ends_of_other_systems_do_not_count(self):
        path = self.root / "list.txt"
        for stored in (b"\xef\xbb\xbfa 1\r\nb 2", b"a 1\rb 2", b"a 1\n\xef\xbb\xbfb 2"):
            path.write_bytes(stored)
            self.assertEqual(read_text(path), "a 1\nb 2")
        for encoding in ("utf-16", "utf-32", "utf-16-be"):
            path.write_bytes(("\ufeff" if encoding.endswith("be") else "").encode(encoding) + "a".encode(encoding))
            with self.assertRaisesRegex(DataError, "byte order mark of UTF"):
                read_text(path)

    def test_a_drive_is_read_whatever_wrote_its_files(self):
        for folder in ("images", "labels"):
            (self.root / folder).mkdir()
        for name in ("1.jpeg", "02.PNG"):
            cv2.imwrite(str(self.root / "images" / name.lower()), np.zeros((20, 40, 3), np.uint8))
        (self.root / "images" / "02.png").rename(self.root / "images" / "02.PNG")
        (self.root / "frames.csv").write_bytes(b"\xef\xbb\xbfframe,chainage_m,potholes\r\n02,5,1\r\n1,0,0\r\n")
        (self.root / "labels" / "1.txt").touch()
        (self.root / "labels" / "02.txt").write_bytes(b"\xef\xbb\xbf0 0.5 0.5 0.1 0.1\r\n")
        drive = read_drive(self.root)
        self.assertEqual([frame.picture.name for frame in drive], ["1", "02"])
        self.assertEqual(len(drive[1].picture.boxes), 1)
        pictures = read_folder(self.root / "images", self.root / "labels", [POTHOLE])
        self.assertEqual([picture.name for picture in pictures], ["1", "02"])


class Figures(unittest.TestCase):
    def test_nothing_is_never_zero(self):
        self.assertEqual((share(0, 0), share(0, 2), mean([]), mean([None]), mean([None, 1.0, 2.0])), (None, 0.0, None, None, 1.5))
        self.assertEqual((text(None), text(0.0), text(0.126, 2)), ("none", "0.000", "0.13"))


if __name__ == "__main__":
    unittest.main()
