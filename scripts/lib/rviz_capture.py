"""Virtual displays, rviz on them, and the live map in headless Chromium, for pictures and tests."""

import os
import pathlib
import subprocess
import tempfile
import time

CHROMIUM_FLAGS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
                  "--disable-background-networking", "--disable-component-update", "--disable-sync")
RVIZ_FOLDER = pathlib.Path(__file__).resolve().parents[2] / "rviz"


class VirtualDisplay:
    """An Xvfb on a display number of its own; leaving the `with` block ends it."""

    def __init__(self, width, height):
        self.size = f"{width}x{height}x24"

    def __enter__(self):
        read, write = os.pipe()
        self.server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(write), "-screen", "0", self.size, "-nolisten", "tcp"],
            pass_fds=[write], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(write)
        with os.fdopen(read) as numbers:
            number = numbers.readline().strip()
        if not number:
            raise RuntimeError("Xvfb did not start")
        self.name = ":" + number
        return self

    def __exit__(self, *_):
        self.server.terminate()
        self.server.wait()

    def photograph(self, path):
        subprocess.run(["import", "-display", self.name, "-window", "root", str(path)], check=True,
                       stdout=subprocess.DEVNULL)


def rviz_file(name):
    """rviz/NAME.rviz of the source tree, or of the installed package."""
    source = RVIZ_FOLDER / f"{name}.rviz"
    if source.is_file():
        return source
    import rospkg
    return pathlib.Path(rospkg.RosPack().get_path("livemap")) / "rviz" / f"{name}.rviz"


def shifted_view(rviz_file_path, directory, east_m):
    """A copy of a top-down view, in `directory`, that looks at a place east of the map's origin."""
    text = pathlib.Path(rviz_file_path).read_text()
    shifted = text.replace("      X: 0\n", f"      X: {east_m}\n")
    if shifted == text:
        raise RuntimeError(f"{rviz_file_path} has no 'X: 0' in its view")
    path = pathlib.Path(directory) / pathlib.Path(rviz_file_path).name
    path.write_text(shifted)
    return path


def start_rviz(rviz_file_path, display, master_uri, log=subprocess.DEVNULL):
    environment = dict(os.environ, DISPLAY=display.name, ROS_MASTER_URI=master_uri,
                       ROS_HOSTNAME="127.0.0.1", LIBGL_ALWAYS_SOFTWARE="1",
                       QT_X11_NO_MITSHM="1", XDG_RUNTIME_DIR=tempfile.mkdtemp())
    return subprocess.Popen(["rviz", "-d", str(rviz_file_path)], env=environment, stdout=log,
                            stderr=subprocess.STDOUT)


def photograph_map(url, path, hazard=None, width=1440, height=900):
    """The live map with the popup of `hazard` open, by its id; else that of the first of its list."""
    from selenium import webdriver
    from selenium.webdriver.common.by import By
    options = webdriver.ChromeOptions()
    options.binary_location = "/usr/bin/chromium"
    for flag in CHROMIUM_FLAGS + (f"--window-size={width},{height}",
                                  "--user-data-dir=" + tempfile.mkdtemp()):
        options.add_argument(flag)
    browser = webdriver.Chrome(options=options)
    try:
        browser.get(url)
        deadline = time.monotonic() + 20
        while not browser.find_elements(By.CSS_SELECTOR, "#hazard-list button"):
            if time.monotonic() > deadline:
                raise RuntimeError("the live map lists no hazard")
            time.sleep(0.2)
        chosen = "" if hazard is None else f'[data-hazard="{hazard}"]'
        browser.find_elements(By.CSS_SELECTOR, f"#hazard-list button{chosen}")[0].click()
        time.sleep(2)
        browser.save_screenshot(str(path))
    finally:
        browser.quit()
