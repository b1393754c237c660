# SPDX-License-Identifier: Apache-2.0
"""Tests of the ROS side: on this machine only, in ROS domains of their own, with checked message fields."""

import os
import signal
from collections.abc import Callable, Iterator
from itertools import count

import pytest
import rclpy
from process import Client, Process

from billiards_sim.ros.process import STOPPING, claim_domain
from billiards_sim.ros.table_node import TableNode

_starts = count(os.getpid())
OWN_DOMAIN, _own_claim = claim_domain(next(_starts))  # tests run side by side in several processes

os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"
os.environ["ROS_DOMAIN_ID"] = str(OWN_DOMAIN)
for number in STOPPING:
    if signal.getsignal(number) is signal.SIG_IGN:  # under nohup or in the background: processes would inherit it
        signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)
for name in ("RMW_IMPLEMENTATION", "ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS"):
    os.environ.pop(name, None)


@pytest.fixture(scope="session", autouse=True)
def ros_log_directory(tmp_path_factory: pytest.TempPathFactory) -> None:
    os.environ["ROS_LOG_DIR"] = str(tmp_path_factory.mktemp("ros_log"))


class Site:
    """A ROS domain of its own and the processes and clients in it."""

    def __init__(self) -> None:
        self.domain, self._claim = claim_domain(next(_starts))
        self._open: list[Process | Client] = []

    def process(self, *arguments: str, **options: object) -> Process:
        process = Process([*arguments], self.domain, **options)
        self._open.append(process)
        return process

    def table(self, *parameters: str, remap: str | None = None) -> Process:
        """A running table; parameters as NAME:=VALUE."""
        given = [part for parameter in parameters for part in ("-p", parameter)]
        table = self.process("table", "--ros-args", *given, *(("-r", remap) if remap else ()))
        table.wait_for("ready: ")
        return table

    def client(self, namespace: str = "") -> Client:
        """A node that hears everything that a running table publishes."""
        client = Client(self.domain, namespace)
        self._open.append(client)
        client.connect()
        return client

    def close(self) -> None:
        for one in reversed(self._open):
            one.close()
        self._claim.close()


@pytest.fixture
def site() -> Iterator[Site]:
    site = Site()
    yield site
    site.close()


@pytest.fixture(scope="module")
def shared_site() -> Iterator[Site]:
    site = Site()
    yield site
    site.close()


@pytest.fixture
def make_node() -> Iterator[Callable[..., TableNode]]:
    nodes = []

    def make(*given: str) -> TableNode:
        rclpy.init(args=["table", "--ros-args", *(part for one in given for part in ("-p", one))])
        nodes.append(TableNode())
        return nodes[-1]

    yield make
    for node in nodes:
        node.destroy_node()
    rclpy.try_shutdown()


@pytest.fixture
def table(make_node: Callable[..., TableNode]) -> TableNode:
    """The paper's table in this process, at rest; nothing spins it, and its time stands still."""
    node = make_node("scene:=rack")
    node.start()
    return node
