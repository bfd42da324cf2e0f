"""`autocomplete dataset`: labelled sticks, from hands to a file that a model is trained on."""

import argparse
import importlib

EXPLANATION = """\
From a person's own flights to a model of their hands (docs/data.md):
  autocomplete dataset record --label arc --count 10 --operator ana --out ana.npz
  autocomplete dataset check ana.npz
  autocomplete dataset stats ana.npz
  autocomplete train --finetune ana.npz --out models/ana
  autocomplete run classifier --model models/ana/intent.onnx

'autocomplete dataset COMMAND --help' tells more of each, with examples."""

COMMANDS = {
    "import": ("import_", "read recordings, flights and the original set's files into one set"),
    "record": ("record", "collect labelled primitives while somebody performs them"),
    "generate": ("generate", "make a set by simulated operators"),
    "stats": ("stats", "counts, lengths and rates of sets, and their length histograms"),
    "check": ("check", "say what is wrong with sets, row by row"),
    "split": ("split", "deal the operators of a set to training, validation and test"),
}
"""Each with its module, whose name may not be Python's."""


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the subcommands with their options."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EXPLANATION
    parser.set_defaults(words=getattr(parser, "words", ()))
    commands = parser.add_subparsers(dest="subcommand", metavar="COMMAND", required=True)
    for name, (module, text) in COMMANDS.items():
        command = commands.add_parser(name, help=text, description=text)
        importlib.import_module(f"cli.dataset.{module}").declare(command)
