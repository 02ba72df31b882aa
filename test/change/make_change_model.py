#!/usr/bin/python3
"""Writes an untrained, seeded network of change and what training/predict_change.py makes of two pairs with it.

    make_change_model.py FOLDER

FOLDER/tiny.yaml with its graphs and golden outputs, FOLDER/pairs (VL-CMU-CD's layout), FOLDER/predictions. Without torch or onnx
nothing is written and the exit status is 77: skipped.
"""

import contextlib
import io
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "training")]

SKIPPED = 77
FILES_OF_THE_NETWORK = ("change/network.py", "change/onnx_model.py", "change/manifest.py", "change/inference.py", "predict_change.py")


def write_checkpoint(path):
    """Random weights, whose answers differ from pixel to pixel and are sure of something here and there."""
    import torch
    from change.network import ChangeNetwork

    torch.manual_seed(11)
    network = ChangeNetwork()
    with torch.no_grad():
        network.final[-1].weight.mul_(40)
    torch.save({"settings": {"architecture": "change-small"}, "average": network.state_dict()}, path)


def write(folder):
    """Everything; quiet but for mistakes."""
    import export_change
    import predict_change
    from tests.synthetic_change import street, write_pair

    checkpoint = folder / "tiny.pt"
    write_checkpoint(checkpoint)
    for number, (first, second) in enumerate(((False, True), (True, False))):
        write_pair(folder / "pairs", number, *street(number + 1, first, second))
    programs = (
        (export_change, ("--checkpoint", checkpoint, "--name", "tiny", "--out", folder, "--threads", 1)),
        (predict_change, ("--manifest", folder / "tiny.yaml", "--pairs", folder / "pairs", "--out", folder / "predictions",
                          "--registered", "--threads", 1)),
    )
    for program, arguments in programs:
        with contextlib.redirect_stdout(io.StringIO()):
            status = program.main([str(argument) for argument in arguments])
        if status != 0:
            return status
    return 0


def main():
    folder = Path(sys.argv[1])
    try:
        import onnx  # noqa: F401
        import torch  # noqa: F401
    except ImportError as missing:
        print(f"skipped, {missing}")
        return SKIPPED
    # Made once: it takes seconds, and depends on nothing but these files.
    made = folder / "made_of"
    sources = [Path(__file__)] + [ROOT / "training" / name for name in FILES_OF_THE_NETWORK]
    made_of = "".join(source.read_text() for source in sources)
    if made.is_file() and made.read_text() == made_of:
        return 0
    folder.mkdir(parents=True, exist_ok=True)
    status = write(folder)
    if status == 0:
        made.write_text(made_of)
    return status


if __name__ == "__main__":
    sys.exit(main())
