"""The command ``chmarl-pb play``: drive the robots in the browser, or watch policies drive them."""

import argparse
import socket
import threading
import webbrowser
from collections.abc import Sequence
from ipaddress import ip_address
from typing import TYPE_CHECKING

from chmarl_pb.cli.arguments import (
    GOAL,
    add_catalog,
    add_home,
    add_max_steps,
    add_messages,
    add_robots,
    add_track,
    check_home,
)
from chmarl_pb.envs.options import SENSORS
from chmarl_pb.extras import check
from chmarl_pb.policies.sources import find_policy

if TYPE_CHECKING:
    from chmarl_pb.viewer.live.choice import Choice

_POLICIES = ("search", "belief", "planner", "random")
PAGE = {"port": 8017, "host": "127.0.0.1", "no_open": False}
"""Options that say where a page is served, with their defaults."""


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options to a parser."""
    parser.set_defaults(run=_run)
    parser.add_argument("--task", metavar="ID", help="task to begin with, e.g. test-unseen-007 (default: a good one)")
    add_home(parser, "a task is drawn for it")
    add_track(parser)
    add_messages(parser)
    add_max_steps(parser)
    add_robots(parser)
    add_catalog(parser)
    parser.add_argument(
        "--observation", default="scene_graph", metavar="O",
        help=f"what policies observe: {', '.join(SENSORS)}, or several joined by + (default: scene_graph)",
    )  # fmt: skip
    parser.add_argument(
        "--policy", action="append", default=[], metavar="P",
        help=f"offer this one, too: a name, a checkpoint or module:callable; beside {', '.join(_POLICIES)}",
    )  # fmt: skip
    parser.add_argument("--goal", action="store_true", help=GOAL)
    add_page(parser)


def add_page(parser: argparse.ArgumentParser) -> None:
    """Add the options that say where a page is served."""
    parser.add_argument(
        "--port",
        type=int,
        default=PAGE["port"],
        metavar="N",
        help="port, or one of the next if it is taken (default: %(default)s)",
    )
    parser.add_argument(
        "--host", default=PAGE["host"], metavar="H",
        help="address to listen on (default: %(default)s, this machine alone); with another all who reach it and know "
        "the token can drive, and see what is sent, as nothing is encrypted",
    )  # fmt: skip
    parser.add_argument("--no-open", action="store_true", help="do not open the browser")


def _run(options: argparse.Namespace) -> int:
    """Serve the page until the process is interrupted."""
    check_home(options)
    check("chmarl-pb play", "viewer", "viser")
    from chmarl_pb.viewer.live.choice import Choice

    for policy in options.policy:
        find_policy(policy)
    choice = Choice(
        options.task, options.home, 0, options.track, options.messages, options.max_steps, options.observation,
        options.robots, options.catalog, {"goal": True} if options.goal else {},
    )  # fmt: skip
    return serve(choice, options.policy, options)


def serve(choice: "Choice", policies: Sequence[str], options: argparse.Namespace, driver: str | None = None) -> int:
    """Serve the page until the process is interrupted.

    Args:
        choice: what the first episode is begun with.
        policies: that are on offer beside the usual ones.
        options: with ``host``, ``port`` and ``no_open``.
        driver: policy that drives all robots from the start; None: people do.
    """
    from chmarl_pb.viewer.live.gate import Gate, guarded_server, stop
    from chmarl_pb.viewer.live.session import Session

    gate = Gate()
    server = guarded_server(gate, options.host, options.port)
    try:
        session = Session(server, choice, tuple(dict.fromkeys((*_POLICIES, *policies))), driver)
        try:
            _announce(f"http://{_reachable(options.host)}:{server.get_port()}/?token={gate.token}", options)
            threading.Event().wait()
        finally:
            session.close()
    finally:
        stop(server)
    return 0


def _announce(address: str, options: argparse.Namespace) -> None:
    if not _is_loopback(options.host):
        print("All who can reach this machine and know the token can drive; nothing is encrypted on the way.")
    print(address, flush=True)
    if not options.no_open:
        webbrowser.open(address)


def _reachable(host: str) -> str:
    """Return a host as it stands in an address; one that means all addresses as this machine's name."""
    if host in ("0.0.0.0", "::", ""):
        return socket.gethostname()
    return f"[{host}]" if ":" in host else host


def _is_loopback(host: str) -> bool:
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
