"""`autocomplete contract`: the wire contract as a page, made from the code that keeps it."""

import argparse
import sys
from collections.abc import Sequence
from inspect import cleandoc
from typing import Any

from msgspec import inspect

from cli import options as opts
from common import CONTRACT_VERSION
from common import messages as m
from common.topics import DEFAULT_VEHICLE, QUERIES, ROOT, SERVICES, TOPICS, VEHICLE_PATTERN, Topic

_INTRODUCTION = """\
# The wire contract, version {version}

Made from `common/topics.py` and `common/messages.py` by `autocomplete contract`; change it there.
Two processes that keep this page understand one another, whatever they are written in.

## Keys

- A topic or query travels on `{root}/<vehicle>/<name>`. `<vehicle>` is `{pattern}`, by default
  `{vehicle}`; several vehicles share a network.
- A service that runs holds the liveliness token `{root}/<vehicle>/alive/<service>`, where
  `<service>` is one of {services}.

## Payloads

- A payload is one MessagePack map with the fields below as string keys. Its Zenoh encoding is
  `application/msgpack;<Message>/{version}`.
- Readers ignore fields they do not know. A payload that lacks a field, or has one of a wrong type,
  out of its range, NaN or infinite, is dropped whole, counted in `health`, and logged at most once
  a second; the reader goes on.
- `stamp` is when the thing happened, in ns on the clock of the session: UTC, or simulated time.
  `seq` rises by one for each message of one publisher on one topic.
- How fresh a message is, its receiver judges by its own monotonic clock at arrival. Stamps of two
  machines are never subtracted from one another.
- World frame: ENU (x east, y north, z up). Body frame: FLU (x forward, y left, z up). Camera frame:
  z forward, x right, y down. Metres, seconds, radians; angles grow counter-clockwise about z up,
  and yaw 0 looks along world x. Quaternions are [x, y, z, w], body to world.

## Topics

- `stream`: dropped rather than delayed; who wants only the newest keeps only the newest.
- `command`: a stream at real-time priority, worthless after 0.2 s.
- `event`: in order, small, every one counts.

A message older than its age is not to be acted on; a topic that is marked so is recorded.
"""

_HEAD = ("stamp", "seq")


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    opts.add_examples(parser, "autocomplete contract > docs/contract.md")
    parser.set_defaults(action=lambda _: _print())


def _print() -> int:
    sys.stdout.write(page())
    return 0


def page() -> str:
    """The contract as Markdown."""
    parts = [
        _INTRODUCTION.format(
            version=CONTRACT_VERSION,
            root=ROOT,
            vehicle=DEFAULT_VEHICLE,
            pattern=VEHICLE_PATTERN.pattern,
            services=", ".join(f"`{service}`" for service in SERVICES),
        ),
        _table(
            ("topic", "message", "from", "to", "Hz", "class", "age s", "recorded"),
            [_topic_row(topic) for topic in TOPICS.values() if topic.message is not m.Health]
            + [_health_row()],
        ),
        "\n## Messages\n",
        "Each has `stamp` and `seq`, an int >= 0, as well. A `?` marks what may be absent.\n",
        *(_definition(message) for message in _messages()),
        "\n## Queries\n",
        "A bad request is refused with a reply-error, a `QueryError`.\n",
        _table(
            ("key", "request", "reply", "answered by"),
            [
                (f"`{q.name}`", q.request.__name__, q.reply.__name__, q.server)
                for q in QUERIES.values()
            ],
        ),
        "",
        *(_definition(payload) for payload in _query_payloads()),
    ]
    return "\n".join(parts).rstrip() + "\n"


def _messages() -> list[type[m.Payload]]:
    return list(dict.fromkeys(topic.message for topic in TOPICS.values()))


def _query_payloads() -> list[type[m.Payload]]:
    both: list[type[m.Payload]] = []
    for query in QUERIES.values():
        both += [query.request, query.reply]
    both.append(m.QueryError)
    return [payload for payload in dict.fromkeys(both) if payload not in _messages()]


def _topic_row(topic: Topic) -> tuple[str, ...]:
    to = "all" if topic.subscribers == SERVICES else ", ".join(topic.subscribers)
    return (
        f"`{topic.name}`",
        topic.message.__name__,
        topic.publisher,
        to,
        "" if topic.rate_hz is None else f"{topic.rate_hz:g}",
        topic.delivery.value,
        f"{topic.max_age_s:g}",
        "yes" if topic.recorded else "no",
    )


def _health_row() -> tuple[str, ...]:
    row = _topic_row(TOPICS[f"health/{SERVICES[0]}"])
    return ("`health/<service>`", row[1], "every service", *row[3:])


def _definition(payload: type[m.Payload]) -> str:
    info = inspect.type_info(payload)
    assert isinstance(info, inspect.StructType)
    rows = [
        (f"`{field.encode_name}`" + ("" if field.required else "?"), *_type(field.type))
        for field in info.fields
        if field.encode_name not in _HEAD
    ]
    text = cleandoc(payload.__doc__ or "")
    parts = [f"### {payload.__name__}\n", f"{text}\n"]
    if rows:
        parts.append(_table(("field", "type", "range"), rows) + "\n")
    return "\n".join(parts)


def _type(info: inspect.Type) -> tuple[str, str]:
    """A type's name on the wire, and its range."""
    note = ""
    if isinstance(info, inspect.Metadata):
        note = (info.extra_json_schema or {}).get("description", "")
        info = info.type
    name, allowed = _plain_type(info)
    return name, ", ".join(part for part in (allowed, note) if part)


def _plain_type(info: inspect.Type) -> tuple[str, str]:
    match info:
        case inspect.IntType() | inspect.FloatType():
            return "int" if isinstance(info, inspect.IntType) else "float", _interval(info)
        case inspect.StrType(min_length=low, max_length=high):
            return "str", "" if high is None else f"{low or 0} to {high} characters"
        case inspect.BoolType():
            return "bool", ""
        case inspect.BytesType():
            return "bin", ""
        case inspect.LiteralType(values=values):
            return "str", " ".join(f"`{value}`" for value in values)
        case inspect.TupleType(item_types=items):
            name, allowed = _type(items[0])
            return f"[{name} x {len(items)}]", allowed
        case inspect.ListType(item_type=item, min_length=low, max_length=high):
            name, allowed = _type(item)
            size = "" if high is None else f"{low} to {high} of them"
            return f"[{name}, ...]", ", ".join(part for part in (size, allowed) if part)
        case inspect.DictType(value_type=value):
            name, allowed = _type(value)
            return f"map of str to {name}", allowed
        case inspect.UnionType(types=types):
            return _type(next(t for t in types if not isinstance(t, inspect.NoneType)))
    raise NotImplementedError(info)


def _interval(info: Any) -> str:
    if info.ge == -(2**63):
        return "64 bits"
    low = info.ge if info.ge is not None else info.gt
    if low is None:
        return ""
    if info.le is not None and info.gt is None:
        return f"{low:g} to {info.le:g}"
    bound = f"> {low:g}" if info.gt is not None else f">= {low:g}"
    return bound if info.le is None else f"{bound} and <= {info.le:g}"


def _table(headings: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    lines = [headings, tuple("---" for _ in headings), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
