"""Flags whose mistakes are one sentence on standard error and exit 2, without the usage."""

import argparse
import math


class OneSentenceParser(argparse.ArgumentParser):
    def error(self, message):
        self.exit(2, f"{self.prog}: {message}, see --help\n")


def replay_rate(text):
    """A replay's speed factor: what the simulated clock and the vehicle can follow."""
    try:
        rate = float(text)
    except ValueError:
        rate = math.nan
    if not 0.1 <= rate <= 10:
        raise argparse.ArgumentTypeError(f"'{text}', accepted is a number from 0.1 to 10")
    return rate
