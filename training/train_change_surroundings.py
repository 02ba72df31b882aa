#!/usr/bin/python3
"""Teach a trained change network what the surroundings of a pixel say about it (training/change/surroundings.py).

    training/simulate_change.py --out build/training/change_surroundings --first-seed 45001 --worlds 34 --plain
    training/train_change_surroundings.py --start-from build/training/change_small/best.pt \
        --pairs build/training/change_surroundings --validation build/training/change_validation --out build/training/change_whole

The network itself is held fixed; the streets must be others than those it was trained on, on which it is too good. Instead of
its checkpoint the exported NAME.onnx will do; what that had learnt of surroundings is left aside. OUT/best.pt is a checkpoint for
training/export_change.py, which joins those of several runs with other seeds: their refiners err less together. A run that was
stopped, at whatever moment, continues with the same command and --resume.
"""

import argparse
import copy
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Dict, List, Optional, Sequence

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

sys.path.insert(0, str(Path(__file__).parent))
from change import data
from change.classes import NO_CHANGE
from change.inference import fill_invalid, normalise
from change.loss import shares_of
from change.metrics import PixelCounts
from change.network import ChangeNetwork
from change.surroundings import Surroundings, encoded_of, with_present_names
from change.validation import FALSE_POSITIVE_RATES, aligned
from common.figures import text
from common.training import (
    UsageError, add_run_arguments, check_arguments, checkpoint_to_resume, checkpoint_to_start_from, exit_status, learning_rate_factor,
    prepare_device, save_atomically,
)
from export_change import ExportError, load_averaged

HIDDEN, ALL_HIDDEN = 0.3, 0.05
"""Share of the training samples of which a corner, or all, of the earlier picture is hidden: simulated pairs hide few pixels."""

MOST_UNCHANGED_FPR = 0.002
"""Of the pixels of validation pairs in which nothing has changed, how many may count as changed at the likeliest class. On real streets
such pairs are the rule, among the simulated ones every third: a constant on the log-odds corrects the prior, and leaves every ROC as it is."""

LEARNING_RATE, BATCH = 2e-3, 8


@dataclass
class Example:
    """A pair as `Surroundings` sees it, all but the truth in half precision."""

    features: Tensor  # F x h x w, of the network, at stride 2
    encoded: Dict[int, Tensor]  # of the encoder, by level
    unseen: Tensor  # 1 x h x w
    shares: Tensor  # C x h x w: of the classes
    mask: np.ndarray  # H x W
    changed: bool  # anything in the mask


def hide_regions(rng: np.random.Generator, validity: np.ndarray) -> None:
    """Sometimes a corner, or all, of the earlier picture, in place."""
    height, width = validity.shape
    draw = rng.random()
    if draw < ALL_HIDDEN:
        validity[:] = 0
    elif draw < HIDDEN:
        rows, columns = int(rng.uniform(0, 0.6) * height), int(rng.uniform(0, 0.5) * width)
        vertical = slice(rows) if rng.random() < 0.5 else slice(height - rows, height)
        horizontal = slice(columns) if rng.random() < 0.5 else slice(width - columns, width)
        validity[vertical, horizontal] = 0


@torch.no_grad()
def example(network: ChangeNetwork, first: np.ndarray, second: np.ndarray, validity: np.ndarray, mask: np.ndarray) -> Example:
    """What the network makes of a pair."""
    pictures = [torch.from_numpy(normalise(image))[None] for image in (fill_invalid(first, second, validity), second)]
    valid = torch.from_numpy(validity.astype(np.float32))[None, None]
    levels = [network.encode(picture) for picture in pictures]
    shares = shares_of(torch.from_numpy(mask.astype(np.int64))[None], network.logits_stride)[0]
    encoded = {level: part[0].half() for level, part in encoded_of(*levels).items()}
    changed = bool(((mask != NO_CHANGE) & (mask != data.IGNORED)).any())
    return Example(
        network.features(*levels)[0].half(), encoded, network.unseen_cells(valid)[0].half(), shares[0].half(), mask,
        changed,
    )


def training_examples(network: ChangeNetwork, pairs: Sequence[data.Pair], seed: int) -> List[Example]:
    """Every pair twice: as it is, and mirrored with its pictures swapped; parts of some are hidden."""
    examples = []
    for index, pair in enumerate(pairs):
        rng = np.random.default_rng([seed, index])
        first, validity = aligned(pair)
        for one, other, flip in ((first, pair.second, 1), (pair.second, first, -1)):
            valid = validity.copy()
            hide_regions(rng, valid)
            # Where nothing is known both pictures show the later one; what is then seen of it must be seen in either order.
            examples.append(example(network, *(np.ascontiguousarray(part[:, ::flip]) for part in (one, other, valid, pair.mask))))
    return examples


def validation_examples(network: ChangeNetwork, pairs: Sequence[data.Pair]) -> List[Example]:
    """Every pair as it is measured."""
    return [example(network, *(first, pair.second, validity, pair.mask)) for pair in pairs for first, validity in (aligned(pair),)]


def refined_logits(network: ChangeNetwork, examples: Sequence[Example]) -> Tensor:
    """Logits of a batch."""
    features, unseen = (torch.stack([getattr(one, name) for one in examples]).float() for name in ("features", "unseen"))
    encoded = {level: torch.stack([one.encoded[level] for one in examples]).float() for level in examples[0].encoded}
    return network.surroundings(features, network.final[-1](features), unseen, encoded)


def train_epoch(network: ChangeNetwork, examples: Sequence[Example], optimizer: torch.optim.Optimizer, epoch: int, epochs: int, seed: int) -> float:
    """One pass in a random order; the mean loss: cross-entropy, unweighted, as its probabilities are to be true ones."""
    torch.manual_seed(seed * 100003 + epoch)  # of what is hidden: a resumed run draws the same
    order = np.random.default_rng([seed, epoch, 1]).permutation(len(examples))
    steps, total = len(order) // BATCH, 0.0
    network.surroundings.train()
    for step in range(steps):
        for group in optimizer.param_groups:
            group["lr"] = LEARNING_RATE * learning_rate_factor((epoch + step / steps) / epochs)
        batch = [examples[index] for index in order[step * BATCH : (step + 1) * BATCH]]
        shares, logits = torch.stack([one.shares for one in batch]).float(), refined_logits(network, batch)
        loss = -(shares * F.log_softmax(logits, dim=1)).sum() / shares.sum().clamp(min=1)
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.surroundings.parameters(), 5.0)
        optimizer.step()
        total += loss.item()
    return total / max(steps, 1)


@torch.no_grad()
def figures(network: ChangeNetwork, examples: Sequence[Example]) -> dict:
    """F1 at both false positive rates of pairs with changes; what was not seen counts."""
    network.eval()
    counts = PixelCounts()
    for one in examples:
        if one.changed:
            counts.add(network.enlarged(torch.softmax(refined_logits(network, [one]), dim=1))[0].numpy(), one.mask)
    return {f"f1_at_{rate:.2f}": counts.at_false_positive_rate(rate)["f1"] for rate in FALSE_POSITIVE_RATES}


@torch.no_grad()
def prior_correction(network: ChangeNetwork, examples: Sequence[Example]) -> float:
    """By how much the log-odds of a change have to fall for MOST_UNCHANGED_FPR."""
    network.eval()
    log_odds = []
    for one in examples:
        if not one.changed:
            unchanged = network.enlarged(torch.softmax(refined_logits(network, [one]), dim=1))[0, NO_CHANGE].numpy()[one.mask != data.IGNORED]
            log_odds.append(np.log((1 - unchanged).clip(1e-9)) - np.log(unchanged.clip(1e-9)))
    return max(float(np.quantile(np.concatenate(log_odds), 1 - MOST_UNCHANGED_FPR)), 0.0) if log_odds else 0.0


def corrected(network: ChangeNetwork, examples: Sequence[Example]) -> ChangeNetwork:
    """A copy with the prior correction in its bias."""
    network = copy.deepcopy(network)
    with torch.no_grad():
        network.surroundings.refiners[0].correction.bias -= prior_correction(network, examples)
    return network


def run(options: argparse.Namespace) -> None:
    """Train from the checkpoint, or from the start, to the last epoch."""
    check_arguments(options)
    begun = checkpoint_to_resume(options, prepare_device(options))
    torch.manual_seed(options.seed)
    network = load_averaged(checkpoint_to_start_from(options))
    if not isinstance(network, ChangeNetwork):
        raise UsageError(f"--start-from: {options.start_from} is no change-small.")
    network.surroundings = Surroundings(network.widths.final, network.widths.encoder)  # what it had learnt of surroundings is left aside
    network.eval().requires_grad_(False)
    network.surroundings.requires_grad_(True)
    network.surroundings.prior.unseen.requires_grad_(False)
    network.surroundings.weigh.requires_grad_(False)
    optimizer = torch.optim.AdamW([weight for weight in network.parameters() if weight.requires_grad], weight_decay=0.01)
    epoch, best = 0, 0.0
    if begun:
        network.load_state_dict(with_present_names(begun["average"]))
        optimizer.load_state_dict(begun["optimizer"])
        epoch, best = begun["epoch"], begun["best"]
    options.out.mkdir(parents=True, exist_ok=True)
    pairs = data.read_pairs(options.pairs, options.out / "registration.npz")
    held_out = data.read_pairs(options.validation, options.out / "registration_validation.npz")
    print(f"{len(pairs)} pairs, {len(held_out)} for validation", flush=True)
    validation = validation_examples(network, held_out)
    examples = training_examples(network, pairs, options.seed)
    report(f"epoch {epoch}/{options.epochs}", figures(network, validation))
    while epoch < options.epochs:
        began = time.monotonic()
        loss = train_epoch(network, examples, optimizer, epoch, options.epochs, options.seed)
        epoch += 1
        found = figures(network, validation)
        state = {"settings": {"architecture": "change-small"}, "average": network.state_dict(), "optimizer": optimizer.state_dict(), "epoch": epoch}
        score = sum(value or 0.0 for value in found.values())
        if score > best:
            best = score
            save_atomically({**state, "average": corrected(network, validation).state_dict(), "best": best}, options.out / "best.pt")
        save_atomically({**state, "best": best}, options.out / "last.pt")
        report(f"epoch {epoch}/{options.epochs} loss {loss:.4f}", found, f"{time.monotonic() - began:.0f} s")


def report(what: str, found: dict, more: str = "") -> None:
    """A line of progress."""
    print(" ".join([what, *(f"{name} {text(value, 4)}" for name, value in found.items()), more]).rstrip(), flush=True)


def main(arguments: Optional[List[str]] = None) -> int:
    """Exit status: 0 trained, 2 the command line or the data is wrong."""
    parser = argparse.ArgumentParser(description="Teach a trained change network what the surroundings of a pixel say about it.")
    parser.add_argument("--start-from", type=Path, default=Path("models/change-small.onnx"), help="checkpoint, or whole exported graph, of change-small")
    parser.add_argument("--pairs", type=Path, default=Path("build/training/change_surroundings"), help="streets the network was not trained on")
    parser.add_argument("--validation", type=Path, default=Path("build/training/change_validation"), help="other streets, that choose the epoch")
    add_run_arguments(parser, "build/training/change_whole", argparse.Namespace(epochs=8, seed=1), ("epochs", "seed"))
    options = parser.parse_args(arguments)
    return exit_status("train_change_surroundings", lambda: run(options), (ExportError, data.DataError))


if __name__ == "__main__":
    sys.exit(main())
