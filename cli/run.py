"""`autocomplete run SERVICE`: one service, anywhere."""

import argparse
import ast
import dataclasses
import inspect
import itertools
import textwrap
from collections.abc import Sequence

from cli import options as opts
from cli.extras import needing
from common.config import choices_of
from common.run import config_type_of, run_service
from common.topics import SERVICES


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options; those of a service's configuration come from its dataclass."""
    parser.add_argument("service", metavar="SERVICE", choices=SERVICES, help=", ".join(SERVICES))
    opts.add_network(parser)
    parser.add_argument(
        "--config", metavar="FILE", type=opts.existing_file, help="TOML with a table a service"
    )
    service = _service_in(getattr(parser, "words", ()))
    fields: list[str] = []
    if service is not None:
        group = parser.add_argument_group(f"configuration of {service}")
        config_type = config_type_of(service)
        meanings = _meanings_in(config_type)
        for field in dataclasses.fields(config_type):
            flag = "--" + field.name.replace("_", "-")
            choices = choices_of(config_type, field.name)
            group.add_argument(
                flag,
                dest=f"set_{field.name}",
                metavar=f"{{{','.join(choices)}}}" if choices else "VALUE",
                help=f"{meanings.get(field.name, '')}{_shown(field.default)}".replace("%", "%%"),
            )
            fields.append(field.name)
    opts.add_examples(
        parser,
        "autocomplete run sim --vehicles 3",
        "autocomplete run overlay --connect tcp/192.168.1.20:7447",
        "autocomplete run operator --config system.toml",
        "autocomplete run localizer --help     # with its configuration",
    )
    parser.set_defaults(action=_run, fields=fields)


def _shown(default: object) -> str:
    """A default as one would type it; of one that is nothing the meaning tells."""
    if default is None or default == "":
        return ""
    return f" ({str(default).lower() if isinstance(default, bool) else default})"


def _service_in(words: Sequence[str]) -> str | None:
    """The service that is asked for; a service's name may also be an option's value."""
    for before, word in zip(("", *words), words, strict=False):
        if word in SERVICES and not (before.startswith("--") and "=" not in before):
            return word
    return None


def _meanings_in(config_type: type) -> dict[str, str]:
    """What the strings below its fields say of them."""
    (class_,) = ast.parse(textwrap.dedent(inspect.getsource(config_type))).body
    assert isinstance(class_, ast.ClassDef)
    meanings = {}
    for field, below in itertools.pairwise(class_.body):
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
            match below:
                case ast.Expr(ast.Constant(str(text))):
                    meanings[field.target.id] = " ".join(text.split())
    return meanings


def _run(options: argparse.Namespace) -> int:
    with needing(options.service):
        return run_service(
            options.service,
            options.vehicle,
            options.connect,
            options.config,
            options.zenoh_config,
            {name: getattr(options, f"set_{name}") for name in options.fields},
        )
