"""`autocomplete worlds`: the places to fly in, and pictures of them."""

import argparse
import json
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

import worlds
from cli import options as opts

WIDTH, HEIGHT = 560, 400
"""Of the plan, and of the view beside it, in pixels."""


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument(
        "worlds", metavar="WORLD", nargs="*", help="names, or YAML files of your own (all)"
    )
    parser.add_argument("--json", action="store_true", help="as one JSON object")
    parser.add_argument(
        "--draw", metavar="FOLDER", type=Path, help="draw a plan and a view of each, as NAME.jpg"
    )
    opts.add_examples(
        parser,
        "autocomplete worlds",
        "autocomplete worlds --draw pictures",
        "autocomplete worlds my-hall.yaml --draw .",
    )
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> int:
    chosen = [worlds.load(name) for name in options.worlds or worlds.names()]
    if options.draw is not None:
        _draw(chosen, options.draw)
    rows = [_row(world) for world in chosen]
    if options.json:
        print(json.dumps({"worlds": rows}))
        return 0
    table = Table("world", "ideal path", "m", "bodies", "", box=box.SIMPLE_HEAD, pad_edge=False)
    for row in rows:
        length = f"{row['length_m']:.1f}" if row["length_m"] else ""
        path = ", ".join(row["primitives"])
        table.add_row(row["name"], path, length, str(row["bodies"]), row["description"])
    Console().print(table)
    return 0


def _row(world: worlds.World) -> dict[str, Any]:
    return {
        "name": world.name,
        "description": world.description,
        "primitives": list(dict.fromkeys(segment.primitive for segment in world.segments)),
        "length_m": round(sum(segment.length_m for segment in world.segments), 2),
        "closed": world.closed,
        "bodies": len(world.bodies),
    }


def _draw(chosen: list[worlds.World], folder: Path) -> None:
    """Draw each world into a picture.

    Raises:
        OSError: if a picture cannot be written.
    """
    import cv2
    import numpy as np

    from services.sim.portrait import plan_of, view_of_world
    from services.sim.studio import open_renderer

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OSError(f"--draw: {folder}: {error.strerror}") from None
    renderer = open_renderer("auto")
    try:
        for world in chosen:
            plan = plan_of(world, renderer, WIDTH, HEIGHT)
            view = view_of_world(world, renderer, WIDTH, HEIGHT)
            file = folder / f"{Path(world.name).stem}.jpg"
            if not cv2.imwrite(str(file), np.hstack([plan, view]), [cv2.IMWRITE_JPEG_QUALITY, 88]):
                raise OSError(f"--draw: {file} cannot be written")
    finally:
        renderer.close()
