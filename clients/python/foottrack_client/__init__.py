"""A client of foottrack for Python: receive poses, publish head poses, ask the service. Blocking and async.

Needs pyzmq, msgpack and ``foottrack_protocol``. A service on this host::

    from foottrack_client import Client

    with Client() as client, client.subscribe("pose/body") as poses:
        for message in poses:
            print(message.data.left)

``AsyncClient`` is the same with ``async for`` and ``await``. Bodies are the models of ``foottrack_protocol.messages``;
frames, units and the clock are those of ``protocol/SPEC.md``.
"""

from foottrack_client.aio import AsyncClient, AsyncSubscription
from foottrack_client.blocking import Client, Subscription
from foottrack_client.clock import Clock
from foottrack_client.endpoints import Endpoints
from foottrack_client.errors import ClientError, KeyFileError, NoAnswer, NotReady, RequestFailed
from foottrack_client.keys import Keys
from foottrack_client.publisher import Publisher
from foottrack_client.receiver import Statistics, TopicStatistics

__all__ = [
    "AsyncClient",
    "AsyncSubscription",
    "Client",
    "ClientError",
    "Clock",
    "Endpoints",
    "KeyFileError",
    "Keys",
    "NoAnswer",
    "NotReady",
    "Publisher",
    "RequestFailed",
    "Statistics",
    "Subscription",
    "TopicStatistics",
]
