"""`autocomplete dataset split`: whole operators to training, validation and test."""

import argparse

from cli import options as opts
from cli.dataset import shared
from cli.extras import needing


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("file", metavar="FILE.npz", type=opts.existing_file)
    parser.add_argument("--seed", type=opts.seed, default=0, help="same seed, same split (0)")
    parser.description = (
        "Writes FILE.train.npz, FILE.validation.npz and FILE.test.npz, which share no operator:"
        " 20 % of the operators to test, 16 % to validate, the rest to train."
    )
    opts.add_examples(parser, "autocomplete dataset split all.npz --seed 1")
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> int:
    with needing("training"):
        from training.dataset.split import split_by_operator
        from training.dataset.store import open_set, save
    stored = open_set(options.file)
    split = split_by_operator(stored.primitives(), options.seed)
    provenance = shared.made(stored.provenance, options)
    for name, part in vars(split).items():
        path = options.file.with_suffix(f".{name}.npz")
        save(path, part, provenance)
        operators = len({p.operator for p in part})
        print(f"{path}: {len(part)} primitives by {operators} operators")
    return 0
