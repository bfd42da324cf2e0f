"""The program of one's own in docs/network.md speaks the contract, as it is printed there."""

import re
import socket
import subprocess
import sys
from pathlib import Path

import zenoh

from common import messages as m
from common.topics import DEFAULT_VEHICLE, key_of
from common.zenoh_bus import router_config

PAGE = Path(__file__).parents[3] / "docs" / "network.md"
FASTER = 20
"""Its pauses are so much shorter here."""
TIMEOUT_S = 20.0


def suggestion() -> m.Suggestion:
    return m.Suggestion(
        stamp=1,
        seq=0,
        id=1,
        primitive="line",
        params={},
        path=[(0.0, 0.0, 1.0, 0.0), (1.0, 0.0, 1.0, 0.0)],
        closed=False,
        speed=0.8,
        fit_rms=0.0,
        confidence=0.9,
        heading_sector=0,
    )


def key(name: str) -> str:
    return key_of(DEFAULT_VEHICLE, name)


def test_the_program_takes_off_flies_accepts_and_lands(tmp_path: Path) -> None:
    (text,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(), flags=re.DOTALL)
    program = tmp_path / "operator.py"
    hurry = f"import time; _sleep = time.sleep; time.sleep = lambda s: _sleep(s / {FASTER})\n"
    program.write_text(hurry + text)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"

    sticks: list[m.Stick] = []
    encodings: set[str] = set()
    decisions: list[tuple[m.DecideRequest, m.Stick]] = []

    with zenoh.open(router_config(endpoint)) as router:

        def hear(sample: zenoh.Sample) -> None:
            encodings.add(str(sample.encoding))
            sticks.append(m.decode(sample.payload.to_bytes(), m.Stick))
            if len(sticks) % 50 == 0:
                router.put(key("suggestion"), m.encode(suggestion()))

        def answer(query: zenoh.Query) -> None:
            with query:
                assert query.payload is not None
                request = m.decode(query.payload.to_bytes(), m.DecideRequest)
                decisions.append((request, sticks[-1]))
                reply = m.DecideReply(ok=True, reason=request.action, mode="hover")
                query.reply(query.key_expr, m.encode(reply))

        kept = (
            router.declare_subscriber(key("stick"), hear),
            router.declare_queryable(key("autopilot/decide"), answer),
        )
        done = subprocess.run(
            [sys.executable, program, endpoint],
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
            check=False,
        )
        assert kept

    assert done.returncode == 0, done.stderr
    assert "suggested: line" in done.stdout
    assert encodings == {m.encoding_of(m.Stick)}
    assert [stick.seq for stick in sticks] == sorted({stick.seq for stick in sticks})
    assert max(stick.vx for stick in sticks) > 0.5
    assert [request.action for request, _ in decisions] == ["takeoff", "accept", "land"]
    assert len({request.nonce for request, _ in decisions}) == len(decisions)
    # Whoever accepts has let go of the sticks.
    assert all(stick.vx == 0.0 for _, stick in decisions)
