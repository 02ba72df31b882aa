#!/usr/bin/python3
"""Every topic and service that a node's source names stands in its page of docs/reference/nodes, and the other way round."""

import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGES = ROOT / "docs/reference/nodes"
HEADINGS = ["Subscribed topics", "Published topics", "Services", "Parameters", "Diagnostics"]
CALL = re.compile(r"(?:advertise|subscribe)(?:Camera|Service)?(?:<[\w:]+>)?\(([^;{]*?)[;{]", re.DOTALL)
NAME = re.compile(r'"(/?[a-z_]+(?:/[a-z_]+)*)"')
# What these carry is a parameter.
BY_PARAMETER = {"mqtt_bridge"}
# Of diagnostic_updater and tf2; and the ending of a topic that stands in the same row.
BY_LIBRARY = {"/diagnostics", "tf", "/tf", "/tf_static", "/compressed"}


def sources(node):
    """The node's own files, and what it uses of those that all nodelets share."""
    folder = ROOT / "src/nodelets" / node
    files = folder.iterdir() if folder.is_dir() else (ROOT / "src/nodes").iterdir()
    own = [file for file in files if file.suffix in (".cpp", ".h")]
    text = "".join(file.read_text(encoding="utf-8") for file in own)
    return own + [file for file in (ROOT / "src/nodelets").glob("*.cpp")
                  if f'#include "nodelets/{file.stem}.h"' in text]


def names_in_source(node):
    names = set()
    for file in sources(node):
        for call in CALL.findall(file.read_text(encoding="utf-8")):
            names.update(NAME.findall(call))
    return {f"{node}/{name}" if name == "reset" else name for name in names}


def sections(page):
    return dict(re.findall(r"^## ([^\n]+)\n(.*?)(?=^## |\Z)", page, re.DOTALL | re.MULTILINE))


def first_column(section):
    names = set()
    for line in section.splitlines():
        if line.startswith("| ") and not line.startswith(("| topic", "| service")):
            names.update(re.findall(r"`(/?[a-z_]+(?:/[a-z_]+)*)`", line.split("|")[1]))
    return names


class ReferencePagesTest(unittest.TestCase):
    def test_every_node_has_a_page_with_the_same_headings(self):
        nodes = {folder.name for folder in (ROOT / "src/nodelets").iterdir() if folder.is_dir()} | {"zone_cloudlet"}
        self.assertEqual({page.stem for page in PAGES.glob("*.md")}, nodes)
        for node in nodes:
            page = (PAGES / f"{node}.md").read_text(encoding="utf-8")
            self.assertEqual(re.findall(r"^## (.*)$", page, re.MULTILINE), HEADINGS, node)
            self.assertTrue(page.startswith(f"# {node}\n"), node)

    def test_source_and_page_name_the_same_topics(self):
        for page in PAGES.glob("*.md"):
            node = page.stem
            if node in BY_PARAMETER:
                continue
            parts = sections(page.read_text(encoding="utf-8"))
            in_page = set().union(*(first_column(parts[title]) for title in HEADINGS[:3])) - BY_LIBRARY
            in_source = names_in_source(node)
            self.assertTrue(in_source, node)
            self.assertEqual(in_source - in_page - BY_LIBRARY, set(), f"{node}: missing on the page")
            text = "\n".join(file.read_text(encoding="utf-8") for file in sources(node))
            unknown = {name for name in in_page if f'"{name.removeprefix(node + "/")}"' not in text
                       and not name.endswith("camera_info")}
            self.assertEqual(unknown, set(), f"{node}: not in the source")

    def test_the_page_of_former_names_has_all_that_the_readers_refuse(self):
        in_source = set()
        for file in (ROOT / "src/ros/parameters").rglob("*_parameters.cpp"):
            text = file.read_text(encoding="utf-8")
            in_source.update(re.findall(r'Renamed\("(\w+)", "(\w+)"\)', text))
            for body in re.findall(r"void RefuseFormer\w*Names.*?\n}", text, re.DOTALL):
                in_source.update(re.findall(r'{"(\w+)", "(\w+)"}', body))
        page = (ROOT / "docs/reference/former-names.md").read_text(encoding="utf-8")
        self.assertGreater(len(in_source), 10)
        self.assertEqual(set(re.findall(r"\| `(\w+)` \| `(\w+)` \|", page)), in_source)


if __name__ == "__main__":
    unittest.main()
