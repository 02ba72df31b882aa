"""What tests of the command lines share: a generated data set, and running a program."""

import contextlib
import io
import tempfile
import unittest
from pathlib import Path

import torch

import train_detector

from .synthetic import write_data


def quietly(program, *arguments):
    """Exit status and standard error of a program."""
    errors = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(errors):
        try:
            status = program.main([str(argument) for argument in arguments])
        except SystemExit as stop:
            status = stop.code
    return status, errors.getvalue()


class ProgramCase(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.root = Path(cls.folder.name)
        cls.data = write_data(cls.root / "data")
        cls.threads = torch.get_num_threads()

    @classmethod
    def tearDownClass(cls):
        torch.set_num_threads(cls.threads)
        cls.folder.cleanup()

    def train(self, out, *more):
        """Three tiny epochs, the last one of whole frames."""
        return quietly(
            train_detector, "--data", self.data, "--out", self.root / out, "--epochs", 3, "--samples-per-epoch", 4,
            "--batch", 2, "--workers", 0, "--threads", 1, "--device", "cpu", "--validate-every", 3, "--size", "small", *more,
        )
