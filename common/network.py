"""Where processes meet; apart from `zenoh_bus`, whose import costs a command its start."""

import re

ROUTER_PORT = 7447
DEFAULT_ENDPOINT = f"tcp/127.0.0.1:{ROUTER_PORT}"
ENDPOINT_PATTERN = re.compile(r"(tcp|tls|quic|udp|ws|unixsock-stream|serial)/\S+")
