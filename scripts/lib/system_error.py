"""The error that a person is told in one sentence."""


class StartError(RuntimeError):
    """A part that did not start or died, in one sentence."""
