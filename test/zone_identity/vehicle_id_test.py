#!/usr/bin/python3
"""Names and files that the zone's scripts take in, mutated at random: each is accepted and harmless, or
refused by one sentence. The Python side of test/fuzz; LIVEMAP_FUZZ_SEED is the seed (default 1)."""

import os
import random
import re
import sys
import tempfile
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(__file__), "..", "..", "scripts", "lib"))

import broker_files  # noqa: E402
import certificate_authority  # noqa: E402

ROUNDS = 20000
CORPUS = [
    "car-1", "zone", "Zone", "bus_7.north", ".", "..", "../zone", "a/b", "car\n", "car\nuser zone", "+", "#", "$SYS",
    "car 1", "", "x" * 64, "x" * 65, "caf\u00e9", "\u202ecar", "car\x00", "-rf", "%u", "127.0.0.1", "::1",
    "fe80::1%eth0", "host.example", "host..example", "-host", "*.example", "a" * 300, "1.2.3.4\n",
]
HOSTILE = ["\n", "\x00", "/", "..", "#", "+", " ", "%", "\u202e", "\U0001f697", ".", "-", ":", "a", "0"]


def mutated(generator, text):
    for _ in range(generator.randint(1, 4)):
        at = generator.randint(0, len(text))
        choice = generator.randint(0, 3)
        if choice == 0:
            text = text[:at] + generator.choice(HOSTILE) + text[at:]
        elif choice == 1:
            text = text[:at] + text[at + 1:]
        elif choice == 2:
            text = text[:at] + chr(generator.randint(0, 0x2ff)) + text[at + 1:]
        else:
            text = text[:at] + text[:generator.randint(0, len(text))]
    return text[:400]


class Names(unittest.TestCase):
    def setUp(self):
        self.generator = random.Random(int(os.environ.get("LIVEMAP_FUZZ_SEED", "1")))

    def inputs(self):
        yield from CORPUS
        for _ in range(ROUNDS):
            yield mutated(self.generator, self.generator.choice(CORPUS))

    def accepted(self, check, text):
        """What `check` makes of the text; None when it is refused by one sentence."""
        try:
            return check(text)
        except broker_files.Usage as refusal:
            sentence = str(refusal)
            self.assertTrue(sentence)
            self.assertNotIn("\n", sentence)
            return None

    def test_a_vehicles_name_is_one_level_of_a_topic_and_one_part_of_a_path(self):
        accepted = 0
        for text in self.inputs():
            if self.accepted(lambda name: broker_files.require_vehicle(name) or name, text) is None:
                continue
            accepted += 1
            self.assertEqual(os.path.basename(os.path.normpath("/certificates/" + text)), text)
            self.assertRegex(text, re.compile(r"\A[!-~]{1,64}\Z"))
            self.assertFalse(set(text) & set("/+#$%:"), text)
            self.assertNotEqual(text.lower(), broker_files.ZONE_USER)
        self.assertGreater(accepted, 100)

    def test_a_host_is_one_that_a_certificate_can_carry(self):
        accepted = 0
        for text in self.inputs():
            host = self.accepted(certificate_authority.require_host, text)
            if host is None:
                continue
            accepted += 1
            certificate_authority.alternative_names([host])
            self.assertRegex(host, re.compile(r"\A[A-Za-z0-9.:-]+\Z"))
        self.assertGreater(accepted, 100)

    def test_a_damaged_register_is_refused_by_one_sentence(self):
        originals = ['{"format": 1, "vehicles": {}}', "[]", "7", "null", '{"format": 2}', "", "[" * 100000,
                     '{"format": [1]}']
        with tempfile.TemporaryDirectory() as directory:
            for number in range(ROUNDS // 100):
                text = originals[number % len(originals)]
                if number >= len(originals):
                    text = mutated(self.generator, text)
                with open(os.path.join(directory, certificate_authority.REGISTER), "w", encoding="utf-8",
                          errors="surrogatepass") as file:
                    file.write(text)
                try:
                    # A register that is sound lacks its key here.
                    self.assertIsNone(self.accepted(certificate_authority.load, directory))
                except FileNotFoundError as missing:
                    self.assertIn("key.pem", str(missing))


if __name__ == "__main__":
    unittest.main()
