"""Parts of every training: command line, schedule, averaged weights, checkpoints and the loop over the epochs."""

import argparse
import copy
import math
import os
import sys
import time
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple, Type

import cv2
import numpy as np
import torch
from torch import nn
from torch.utils.data import Dataset

from .figures import text


class UsageError(Exception):
    """The command line or a file it names is wrong; the text is one sentence for the user."""


class EpochSamples(Dataset):
    """The samples of one epoch. Sample i depends on (seed, epoch, i) only."""

    def __init__(self, augmenter: Any, seed: int, epoch: int, count: int):
        self.augmenter, self.seed, self.epoch, self.count = augmenter, seed, epoch, count

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, index: int) -> Any:
        return self.augmenter.draw(np.random.default_rng([self.seed, self.epoch, index]))


class ModelEma:
    """Exponential moving average of the weights and of the batch-norm statistics."""

    DECAY = 0.999

    def __init__(self, model: nn.Module):
        self.model = copy.deepcopy(model).eval()
        self.updates = 0

    @torch.no_grad()
    def update(self, model: nn.Module) -> None:
        """Move the average towards the model; early on faster, to forget the random start."""
        self.updates += 1
        decay = min(self.DECAY, (1 + self.updates) / (10 + self.updates))
        for average, current in zip(self.model.state_dict().values(), model.state_dict().values()):
            if average.dtype.is_floating_point:
                average.lerp_(current, 1 - decay)
            else:
                average.copy_(current)


def learning_rate_factor(progress: float, warm_up: float = 0.02, last: float = 0.02) -> float:
    """Linear warm-up, then half a cosine down to `last`; progress runs from 0 to 1."""
    if progress < warm_up:
        return progress / warm_up
    return last + (1 - last) * 0.5 * (1 + math.cos(math.pi * (progress - warm_up) / (1 - warm_up)))


def decayed_groups(model: nn.Module, weight_decay: float) -> List[dict]:
    """An optimizer's groups of what is trained: biases and normalisation parameters do not decay."""
    trained = [parameter for parameter in model.parameters() if parameter.requires_grad]
    return [
        {"params": [parameter for parameter in trained if (parameter.dim() > 1) == matrices], "weight_decay": decay}
        for decay, matrices in ((weight_decay, True), (0.0, False))
    ]


def save_atomically(content: Dict[str, Any], path: Path) -> None:
    """Write a checkpoint so that a kill at any moment leaves the old or the new one, never a torn one."""
    temporary = path.with_suffix(".tmp")
    with open(temporary, "wb") as file:
        torch.save(content, file)
        # Else a power loss can leave the new name on bytes that were never written.
        file.flush()
        os.fsync(file.fileno())
    os.replace(temporary, path)


def load_checkpoint(path: Path, device: Any = "cpu") -> Dict[str, Any]:
    """Read what save_atomically wrote; an older program or another tool may have left a torn file."""
    try:
        return torch.load(path, map_location=device)
    except FileNotFoundError:
        raise
    except Exception as error:  # torch tries one format after the other, each with exceptions of its own
        raise UsageError(
            f"{path} is torn or no checkpoint ({' '.join(str(error).split())[:120] or type(error).__name__}); "
            "remove it to begin anew, or put a whole one in its place."
        ) from error


class Run:
    """A training run: a model, the average of its weights, an optimizer, and how far it has come."""

    BEST = ""  # the figure that chooses best.pt; a subclass names it
    GRADIENT_NORM = 10.0

    def __init__(self, settings: Any, model: nn.Module, optimizer: torch.optim.Optimizer):
        self.settings, self.model, self.optimizer = settings, model, optimizer
        self.ema = ModelEma(model)
        self.epoch, self.best = 0, 0.0

    def state(self) -> Dict[str, Any]:
        """Everything that the next epoch depends on."""
        return {
            "settings": asdict(self.settings), "epoch": self.epoch, "best": self.best, "model": self.model.state_dict(),
            "average": self.ema.model.state_dict(), "updates": self.ema.updates, "optimizer": self.optimizer.state_dict(),
        }

    def restore(self, state: Dict[str, Any]) -> None:
        """Continue from `state`, which must come from a run with the same settings."""
        written = {**asdict(type(self.settings)()), **state["settings"]}  # older runs had later fields as they are by default
        for name, value in asdict(self.settings).items():
            if written[name] != value:
                raise UsageError(
                    f"The checkpoint was written with {name} {written[name]}, not {value}; "
                    "resume with the same settings or choose another --out."
                )
        self.model.load_state_dict(state["model"])
        self.ema.model.load_state_dict(state["average"])
        self.ema.updates = state["updates"]
        self.optimizer.load_state_dict(state["optimizer"])
        self.epoch, self.best = state["epoch"], state.get("best", state.get("best_ap", 0.0))

    def set_rate(self, rate: float) -> None:
        """The learning rate of the next step; a group has its `multiple` of it."""
        for group in self.optimizer.param_groups:
            group["lr"] = rate * group.get("multiple", 1.0)

    def step(self, loss: torch.Tensor) -> None:
        """One update of the weights and of their average."""
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(self.model.parameters(), self.GRADIENT_NORM)
        self.optimizer.step()
        self.ema.update(self.model)

    def is_done(self) -> bool:
        """Whether the schedule is over."""
        return self.epoch >= self.settings.epochs

    def epoch_text(self) -> str:
        """Which epoch was trained, for the log."""
        return f"{self.epoch}/{self.settings.epochs}"

    def run(self, out: Path, train: Callable[[], dict], measure: Optional[Callable[[], dict]] = None, every: int = 1) -> None:
        """Epochs to the last one; last.pt after each, best.pt where a measurement finds the best figure so far."""
        out.mkdir(parents=True, exist_ok=True)
        while not self.is_done():
            began = time.monotonic()
            report = train()
            save_atomically(self.state(), out / "last.pt")  # a kill while it measures loses no epoch
            if measure and (self.epoch % every == 0 or self.is_done()):
                report.update(measure())
                if report.get(self.BEST, 0.0) > self.best:
                    self.best = report[self.BEST]
                    save_atomically(self.state(), out / "best.pt")
                save_atomically(self.state(), out / "last.pt")
            line = " ".join(f"{name} {text(value, 4)}" for name, value in report.items())
            print(f"epoch {self.epoch_text()} {line} {time.monotonic() - began:.0f} s", flush=True)


def add_run_arguments(parser: argparse.ArgumentParser, out: str, settings: Any, counts: Sequence[str], threads: int = 2) -> None:
    """Flags that every trainer has; `counts` are integer fields of the settings with a flag each."""
    parser.add_argument("--out", type=Path, default=Path(out), help="folder for checkpoints")
    parser.add_argument("--resume", action="store_true", help="continue from OUT/last.pt where it exists")
    parser.add_argument("--threads", type=int, default=threads, help="threads of torch on the CPU")
    for name in counts:
        parser.add_argument("--" + name.replace("_", "-"), type=int, default=getattr(settings, name))


def add_loop_arguments(parser: argparse.ArgumentParser, settings: Any, validate_every: int) -> None:
    """Flags of the trainers that draw new samples in every epoch."""
    parser.add_argument("--workers", type=int, default=1, help="processes that prepare samples")
    parser.add_argument("--validate-every", type=int, default=validate_every, metavar="EPOCHS")
    parser.add_argument("--device", choices=("auto", "cpu", "cuda"), default="auto")
    parser.add_argument("--learning-rate", type=float, default=settings.learning_rate)
    parser.add_argument("--settle", type=float, default=settings.settle, help="last fraction of the epochs: whole pictures, weakly changed")
    parser.add_argument("--precision", choices=("auto", "bf16", "fp32"), default="auto", help="auto: bf16 where the device calculates in it")


def check_arguments(arguments: argparse.Namespace) -> None:
    """Refuse numbers that no trainer takes, of those flags that this one has."""
    given = vars(arguments)
    for name in ("epochs", "samples_per_epoch", "validate_every", "threads"):
        if given.get(name, 1) < 1:
            raise UsageError(f"--{name.replace('_', '-')} must be at least 1, not {given[name]}.")
    samples = "samples_per_epoch" if "samples_per_epoch" in given else "samples"
    if "batch" in given and not 2 <= arguments.batch <= given[samples]:
        raise UsageError(f"--batch must be from 2 to --{samples.replace('_', '-')}, not {arguments.batch}.")
    for name in ("seed", "workers"):
        if given.get(name, 0) < 0:
            raise UsageError(f"--{name} must not be negative, not {given[name]}.")
    if not given.get("learning_rate", 1.0) > 0:
        raise UsageError(f"--learning-rate must be positive, not {arguments.learning_rate}.")
    for name in ("settle", "simulated_share"):
        if not 0 <= given.get(name, 0.0) <= 1:
            raise UsageError(f"--{name.replace('_', '-')} must be from 0 to 1, not {given[name]}.")


def fields_given(kind: Type, arguments: argparse.Namespace) -> Dict[str, Any]:
    """What the command line says about the fields of a settings class."""
    known = {field.name for field in fields(kind)}
    return {name: value for name, value in vars(arguments).items() if name in known}


def prepare_device(arguments: argparse.Namespace) -> torch.device:
    """Set the threads and choose the device; one without --device trains on the CPU."""
    wanted = getattr(arguments, "device", "cpu")
    cuda = torch.cuda.is_available()
    if wanted == "cuda" and not cuda:
        raise UsageError("--device cuda: this torch sees no CUDA device.")
    torch.set_num_threads(arguments.threads)
    cv2.setNumThreads(0)
    return torch.device("cuda" if cuda and wanted != "cpu" else "cpu")


def calculates_in_bf16(device: torch.device) -> bool:
    """Whether bfloat16 is faster than float32 there; a processor without such instructions is ten times slower in it."""
    if device.type == "cuda":
        return torch.cuda.is_bf16_supported()
    try:
        processor = Path("/proc/cpuinfo").read_text().split()
    except OSError:
        return False
    return "avx512_bf16" in processor or "amx_bf16" in processor


def precision_on(device: torch.device, wanted: str, begun: Optional[Dict[str, Any]]) -> str:
    """What --precision means: auto goes on as the checkpoint was written, and begins as the device is fast."""
    if wanted != "auto":
        return wanted
    if begun:
        return begun["settings"].get("precision", "bf16")
    return "bf16" if calculates_in_bf16(device) else "fp32"


def checkpoint_to_resume(arguments: argparse.Namespace, device: torch.device) -> Optional[Dict[str, Any]]:
    """The state in OUT/last.pt where there is one; it is an error where --resume does not ask for it."""
    last = arguments.out / "last.pt"
    if not last.exists():
        return None
    if not arguments.resume:
        raise UsageError(f"{last} exists; continue it with --resume or choose another --out.")
    return load_checkpoint(last, device)


def checkpoint_to_start_from(arguments: argparse.Namespace) -> Path:
    """The file that --start-from names."""
    if not arguments.start_from.is_file():
        raise UsageError(f"--start-from: there is no checkpoint {arguments.start_from}.")
    return arguments.start_from


def exit_status(program: str, run: Callable[[], None], errors: Tuple[Type[Exception], ...]) -> int:
    """0 where `run` ends well, 2 where the command line or a file is wrong: said in one sentence."""
    try:
        run()
    except (UsageError, *errors) as error:
        print(f"{program}: {error}", file=sys.stderr)
        return 2
    return 0
