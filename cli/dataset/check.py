"""`autocomplete dataset check`: what is wrong with sets, row by row."""

import argparse

from cli import options as opts
from cli.extras import needing


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("files", metavar="FILE.npz", nargs="+", type=opts.existing_file)
    parser.description = (
        "Looks at every primitive of a set: unknown labels, times that do not rise, gaps, sticks"
        " beyond [-1, 1] or not finite, too short, at rest, hanging, dead axes, the same twice."
        " A line for each finding; exit code 1 if there is any. 'autocomplete train --finetune'"
        " leaves such primitives out, 'dataset import FILE.npz --sound' writes a set without them."
    )
    opts.add_examples(
        parser,
        "autocomplete dataset check ana.npz",
        "autocomplete dataset check *.npz && autocomplete train --finetune ana.npz",
    )
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> int:
    with needing("training"):
        from training.dataset.check import check_stored
        from training.dataset.store import open_set
    is_wrong = False
    for path in options.files:
        try:
            stored = open_set(path)
        except OSError as error:
            print(error)
            is_wrong = True
            continue
        findings = check_stored(stored)
        for finding in findings:
            print(f"{path}: {finding}")
        verdict = f"{len(findings)} findings" if findings else "nothing is wrong"
        print(f"{path}: {len(stored)} primitives, {verdict}")
        is_wrong = is_wrong or bool(findings)
    return 1 if is_wrong else 0
