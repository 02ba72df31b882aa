"""Folders of pictures and files of text, read alike by every program.

The same rules as src/common/picture_folder.h and src/common/text_file.h, for whom users write the same folders.
"""

import re
from pathlib import Path
from typing import Dict, List, Optional, Tuple

READ = (".jpg", ".jpeg", ".jpe", ".jfif", ".png")
NOT_READ = (".bmp", ".tif", ".tiff", ".webp", ".gif", ".pgm", ".ppm", ".pnm", ".heic", ".heif", ".avif", ".jp2", ".exr", ".hdr", ".jxl")
FOREIGN_MARKS = ((b"\xff\xfe\0\0", "UTF-32"), (b"\0\0\xfe\xff", "UTF-32"), (b"\xff\xfe", "UTF-16"), (b"\xfe\xff", "UTF-16"))


class DataError(Exception):
    """A data folder is missing or not as its layout says; the text is one sentence for the user."""


def natural_key(name: str) -> List[Tuple[int, int, str]]:
    """Sorts names with their numbers read as numbers: img-9 before img-10."""
    return [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in re.split(r"([0-9]+)", name) if part]


def without_leading_zeros(name: str) -> str:
    """gt_007 and gt_7 are gt_7."""
    return re.sub(r"0*([0-9]+)", r"\1", name)


def list_pictures(folder: Path) -> List[Path]:
    """The JPEG and PNG files of a folder in natural order, their extensions spelled in any way; hidden files do not count.

    A picture of a kind that is not read, a link that leads nowhere and two pictures with one name are refused.
    """
    found: Dict[str, Path] = {}
    for path in sorted(folder.iterdir(), key=lambda path: (natural_key(path.name), path.name)) if folder.is_dir() else []:
        ending = path.suffix.lower()
        if path.name.startswith(".") or ending not in READ + NOT_READ or path.is_dir():
            continue
        if not path.exists():
            raise DataError(f"{path} is a link that leads nowhere.")
        if ending in NOT_READ:
            raise DataError(f"The picture {path} would be passed over, accepted are JPEG and PNG.")
        if path.stem in found:
            raise DataError(f"{found[path.stem]} and {path} have one name, accepted is one picture of each.")
        found[path.stem] = path
    return list(found.values())


class PictureFolder:
    """Finds pictures by their names, however the extension is spelled and however many leading zeros a number has."""

    def __init__(self, folder: Path):
        self.paths = list_pictures(folder)
        self.by_stem = {path.stem: path for path in self.paths}
        self.by_number: Dict[str, List[Path]] = {}
        for path in self.paths:
            self.by_number.setdefault(without_leading_zeros(path.stem), []).append(path)

    def find(self, stem: str) -> Optional[Path]:
        """The picture of that name; none without one. Two that differ from it by leading zeros alone are refused."""
        if stem in self.by_stem:
            return self.by_stem[stem]
        same = self.by_number.get(without_leading_zeros(stem), [])
        if len(same) > 1:
            raise DataError(f"{same[0]} and {same[1]} have one number, accepted is one picture of each.")
        return same[0] if same else None


def read_text(path: Path) -> str:
    """A file's text: UTF-8, with or without a byte order mark at the beginning of lines, and with any line ends."""
    try:
        stored = path.read_bytes()
    except OSError as error:
        raise DataError(f"Cannot read {path}: {error}.") from error
    for mark, encoding in FOREIGN_MARKS:
        if stored.startswith(mark):
            raise DataError(f"{path} begins with the byte order mark of {encoding}, accepted is text in UTF-8 or ASCII.")
    try:
        text = stored.decode("utf-8")
    except UnicodeDecodeError as error:
        raise DataError(f"Cannot read {path}: {error}.") from error
    text = text.replace("\r\n", "\n")
    return re.sub("^\ufeff+", "", text.replace("\r", "\n"), flags=re.MULTILINE)
