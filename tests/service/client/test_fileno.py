"""A client among the files that a program of its own waits for."""

import asyncio
import os
import select

from armguard import Client
from armguard.service.wire import Kind

PATIENCE = 20.0


def test_select_waits_for_a_client_together_with_other_files(far, client):
    read, write = os.pipe()
    try:
        assert client.receive() is None
        both = (client, read)
        assert select.select(both, (), (), 0.02) == ([], [], [])
        far.send(far.command(1))
        assert select.select(both, (), (), PATIENCE)[0] == [client]
        os.write(write, b"!")
        assert select.select(both, (), (), PATIENCE)[0] == [client, read]
        assert client.receive().cycle == 1
        assert client.receive() is None
        assert select.select(both, (), (), PATIENCE)[0] == [read]
    finally:
        os.close(read)
        os.close(write)


def test_asyncio_calls_when_there_is_an_answer(far, client):
    async def first() -> int:
        loop = asyncio.get_running_loop()
        came: asyncio.Future[int] = loop.create_future()

        def look() -> None:
            if (answer := client.receive()) is not None and not came.done():
                came.set_result(answer.cycle)

        loop.add_reader(client, look)
        loop.call_later(0.01, lambda: far.send(far.command(4)))
        try:
            return await asyncio.wait_for(came, PATIENCE)
        finally:
            loop.remove_reader(client)

    assert asyncio.run(first()) == 4


def test_a_client_that_is_not_connected_has_no_socket(far):
    client = Client(port=far.port, keys=far.keys)
    assert client.fileno() == -1
    with far.hearing(Kind.HELLO):
        client.connect(PATIENCE)
    assert client.fileno() >= 0
    client.close()
    assert client.fileno() == -1
