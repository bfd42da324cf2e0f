"""`autocomplete run SERVICE`: one service, anywhere."""

import argparse
import dataclasses
import sys

from cli import options as opts
from common.run import config_type_of, run_service
from common.topics import SERVICES


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options; those of a service's configuration come from its dataclass."""
    parser.add_argument("service", metavar="SERVICE", choices=SERVICES, help=", ".join(SERVICES))
    opts.add_network(parser)
    parser.add_argument(
        "--config", metavar="FILE", type=opts.existing_file, help="TOML with a table a service"
    )
    service = next((word for word in sys.argv[2:] if word in SERVICES), None)
    fields: list[str] = []
    if service is not None:
        group = parser.add_argument_group(f"configuration of {service}")
        for field in dataclasses.fields(config_type_of(service)):
            flag = "--" + field.name.replace("_", "-")
            group.add_argument(
                flag, dest=f"set_{field.name}", metavar="VALUE", help=f"({field.default})"
            )
            fields.append(field.name)
    parser.set_defaults(action=_run, fields=fields)


def _run(options: argparse.Namespace) -> int:
    return run_service(
        options.service,
        options.vehicle,
        options.connect,
        options.config,
        options.zenoh_config,
        {name: getattr(options, f"set_{name}") for name in options.fields},
    )
