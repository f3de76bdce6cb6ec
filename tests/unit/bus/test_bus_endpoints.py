"""Binding to anything but loopback is refused, in words."""

from __future__ import annotations

import pytest
import zmq

from foottrack_service.bus import BindFailed, BindRefused, Broker, ControlServer
from foottrack_service.bus.endpoints import Context, bind, check_loopback, release
from foottrack_service.config import BusSettings


@pytest.mark.parametrize(
    "endpoint",
    [
        "tcp://127.0.0.1:7701",
        "tcp://127.8.9.10:*",
        "tcp://localhost:0",
        "tcp://[::1]:7701",
        "inproc://x",
        "ipc:///tmp/x",
    ],
)
def test_loopback_is_accepted(endpoint: str) -> None:
    check_loopback(endpoint)


@pytest.mark.parametrize(
    "endpoint",
    [
        "tcp://*:7701",
        "tcp://0.0.0.0:7701",
        "tcp://[::]:7701",
        "tcp://eth0:7701",
        "tcp://192.168.1.5:7701",
        "tcp://128.0.0.1:7701",
        "tcp://127.0.0.1.example.org:7701",
        "tcp://10.0.0.1;127.0.0.1:7701",
        "tcp://7701",
        "udp://127.0.0.1:7701",
        "ws://127.0.0.1:7701",
        "epgm://127.0.0.1;239.192.1.1:7701",
    ],
)
def test_everything_else_is_refused_with_the_reason(endpoint: str) -> None:
    with pytest.raises(BindRefused, match="neither encrypted nor authenticated") as refused:
        check_loopback(endpoint)
    assert endpoint in str(refused.value)


def test_an_endpoint_without_transport_is_malformed() -> None:
    with pytest.raises(BindFailed, match="needs a transport"):
        check_loopback("127.0.0.1:7701")


@pytest.mark.parametrize("key", ["ingress", "egress"])
def test_a_broker_refuses_before_anything_is_open(context: Context, key: str) -> None:
    settings = BusSettings(ingress="tcp://127.0.0.1:0", egress="tcp://127.0.0.1:0")
    with pytest.raises(BindRefused):
        Broker(settings.model_copy(update={key: "tcp://0.0.0.0:0"}), context).start()


def test_a_control_server_refuses(context: Context) -> None:
    with pytest.raises(BindRefused):
        ControlServer(context, "tcp://*:0", {})


def test_a_taken_port_says_so(context: Context, broker: Broker) -> None:
    with pytest.raises(BindFailed, match="another foottrack"):
        Broker(broker.endpoints, context).start()


def test_a_released_port_is_free_at_once(context: Context) -> None:
    endpoint = "tcp://127.0.0.1:0"
    for _ in range(50):
        socket = context.socket(zmq.XPUB)
        endpoint = bind(socket, endpoint)
        release(socket, endpoint)
        socket.close(0)
