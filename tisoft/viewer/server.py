"""Serves a Controller to browsers: one page, one binary websocket.  The simulation never waits.

To a page: JSON text "hello" once and "status" five times a second; binary pictures

    u32 number, u32 drag, f32 time, f32 top, u32 colour, f32 extra numbers (see `picture`),
    then f32 x, y, z per drawn row, then u8 value per drawn row        (little-endian)

From a page: JSON text orders (see `orders`), and {"ack": number} once a picture is drawn.  At most
UNDER_WAY pictures are under way to a page; further ones are never queued: the newest is sent next.
"""

from __future__ import annotations

import asyncio
import hmac
import http
import json
import logging
import secrets
import socket
import struct
import threading
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from tisoft.errors import SceneError
from tisoft.viewer.controller import Controller
from tisoft.viewer.orders import COLORS, BadOrder, checked
from tisoft.viewer.picture import Snapshot

PAGE = Path(__file__).parent / "page"
FILES = {
    "/": ("page.html", "text/html; charset=utf-8"),
    "/page.js": ("page.js", "text/javascript; charset=utf-8"),
    "/three.min.js": ("three.min.js", "text/javascript; charset=utf-8"),
}
"""All that is served."""
UNDER_WAY = 2
LARGEST = 4096
"""Bytes of a message from a page."""
TELL_EVERY = 0.2
"""Seconds between two statuses."""
QUEUED = 64
"""Orders of one page that may wait for the simulation; then the page is not read for a while."""


def free_port(host: str, first: int) -> int:
    """A port that is free now: the next ones after `first`, else any."""
    for port in [*range(first + 1, min(first + 50, 65_536)), 0]:
        with socket.socket() as probe:
            try:
                probe.bind((host, port))
            except OSError:
                continue
            return int(probe.getsockname()[1])
    return 0


def check_port(host: str, port: int) -> None:
    """Raise SceneError where the port cannot be served now; before a scene is made ready for it."""
    _bound(host, port).close()


def packed(shot: Snapshot) -> bytes:
    """A picture as it travels."""
    head = struct.pack(
        "<IIffI", shot.number, shot.drag, shot.time, shot.top, COLORS.index(shot.color)
    )
    places = shot.extra.astype("<f4").tobytes() + shot.positions.astype("<f4").tobytes()
    return head + places + shot.values.tobytes()


class Server:
    """A page on `host`:`port` (0: any free one), from now until `close`.

    Raises:
        SceneError: the port is taken; says which is free.
    """

    def __init__(self, control: Controller, *, host: str = "127.0.0.1", port: int = 8400) -> None:
        self.control, self.host = control, host
        self.key = secrets.token_urlsafe(16)
        self.sent = 0
        self._told: dict[str, Any] = {}
        self._clients: set[_Client] = set()
        self._hello = {"hello": True, **control.hello()}
        self._socket = _bound(host, port)
        self.port = int(self._socket.getsockname()[1])
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="tisoft page", daemon=True)
        self._thread.start()
        self._ready.wait(10.0)
        control.listeners.append(self._notify)

    @property
    def url(self) -> str:
        """The page's address, with the key that opens it."""
        name = "127.0.0.1" if self.host in ("0.0.0.0", "") else self.host
        return f"http://{name}:{self.port}/?key={self.key}"

    def close(self) -> None:
        """Stop serving."""
        if self._notify in self.control.listeners:
            self.control.listeners.remove(self._notify)
        self._loop.call_soon_threadsafe(self._end.set)
        self._thread.join(5.0)

    def _notify(self) -> None:
        """A new snapshot is there; called by the simulation's thread."""
        self._told = self.control.status()
        self._loop.call_soon_threadsafe(self._wake)

    def _wake(self) -> None:
        for client in self._clients:
            client.event.set()

    # -- the server's thread -------------------------------------------------------------------

    def _serve(self) -> None:
        asyncio.run(self._main())

    async def _main(self) -> None:
        self._loop, self._end = asyncio.get_running_loop(), asyncio.Event()
        quiet = logging.getLogger("tisoft.viewer")
        quiet.addHandler(logging.NullHandler())
        quiet.propagate = False
        async with serve(
            self._talk,
            sock=self._socket,
            process_request=self._answer,
            compression=None,
            max_size=LARGEST,
            logger=quiet,
        ):
            self._ready.set()
            await self._end.wait()

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """A file, a refusal, or None: go on as a websocket."""
        try:
            address = urlsplit(request.path)
        except ValueError:
            return connection.respond(http.HTTPStatus.BAD_REQUEST, "That is no address.\n")
        is_socket = request.headers.get("Upgrade", "").lower() == "websocket"
        if address.path == "/" or is_socket:
            key = parse_qs(address.query).get("key", [""])[0]
            if not hmac.compare_digest(key.encode(), self.key.encode()):
                text = "This address lacks its key; take the one that tisoft view printed.\n"
                return connection.respond(http.HTTPStatus.FORBIDDEN, text)
        if is_socket:
            if not _is_own_page(request.headers):
                text = "A page of another host may not steer this one.\n"
                return connection.respond(http.HTTPStatus.FORBIDDEN, text)
            return None
        if address.path == "/favicon.ico":
            return connection.respond(http.HTTPStatus.NO_CONTENT, "")
        if address.path not in FILES:
            return connection.respond(http.HTTPStatus.NOT_FOUND, "There is no such file.\n")
        name, kind = FILES[address.path]
        body = (PAGE / name).read_bytes()
        headers = {
            "Content-Type": kind,
            "Content-Length": str(len(body)),
            "Cache-Control": "no-store",
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
            "Connection": "close",
        }
        return Response(200, "OK", Headers(headers), body)

    async def _talk(self, ws: ServerConnection) -> None:
        client = _Client(self)
        self._clients.add(client)
        sender = asyncio.create_task(client.send(ws))
        try:
            async for text in ws:
                client.take(text)
                while len(self.control.orders) > QUEUED:
                    await asyncio.sleep(0.01)
        except BadOrder as error:
            await ws.close(1008, str(error)[:120])
        except ConnectionClosed:
            pass
        finally:
            sender.cancel()
            self._clients.discard(client)
            self.control.post({"do": "drop"}, client)  # nobody is there to let go


class _Client:
    """One page, as the server's thread sees it."""

    def __init__(self, server: Server) -> None:
        self.server = server
        self.event = asyncio.Event()
        self.event.set()
        self.acked = 0
        self.last = 0

    def take(self, text: Any) -> None:
        """An acknowledgement or an order; raises BadOrder."""
        try:
            message = json.loads(text) if isinstance(text, str) else None
        except (ValueError, RecursionError):
            message = None
        if not isinstance(message, dict):
            raise BadOrder("a message is a JSON object")
        if set(message) != {"ack"}:
            self.server.control.post(checked(message), self)
            return
        number = message["ack"]
        if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number <= self.last:
            raise BadOrder("a picture is acknowledged that was not sent")
        self.acked = max(self.acked, number)
        self.event.set()

    async def send(self, ws: ServerConnection) -> None:
        """Send what is newest whenever the page has drawn enough of what was sent."""
        server, control = self.server, self.server.control
        under_way: list[int] = []
        told_at = -1.0
        try:
            await ws.send(json.dumps(server._hello))
            while True:
                await self.event.wait()
                self.event.clear()
                under_way = [n for n in under_way if n > self.acked]
                if len(under_way) >= UNDER_WAY:
                    continue
                shot = control.snapshot
                if shot.number > self.last:
                    self.last = shot.number
                    under_way.append(shot.number)
                    server.sent += 1
                    await ws.send(packed(shot))
                    now = server._loop.time()
                    if now - told_at > TELL_EVERY or server._told.get("paused"):
                        told_at = now
                        await ws.send(json.dumps({"status": server._told}))
                control.want()
        except ConnectionClosed:
            pass


def _bound(host: str, port: int) -> socket.socket:
    listening = socket.socket()
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((host, port))
        listening.listen()
    except OSError as error:
        listening.close()
        if port and isinstance(error, OSError) and error.errno in (48, 98, 10048):
            free = free_port(host, port)
            raise SceneError(f"port {port} is taken; {free} is free: add --port {free}") from None
        raise SceneError(f"{host}:{port} cannot be served: {error.strerror or error}") from None
    return listening


def _is_own_page(headers: Headers) -> bool:
    """Whether the page that opens the socket came from the host it asks: no Origin is a program."""
    origin = headers.get("Origin")
    return origin is None or urlsplit(origin).netloc == headers.get("Host")
