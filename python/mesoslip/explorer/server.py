"""The server of the page: it answers this machine only, and no other page in the browser."""

from __future__ import annotations

import asyncio
import gc
import logging
import time
import warnings
import webbrowser
from collections.abc import Awaitable, Callable
from importlib.resources import files
from typing import Any
from urllib.parse import urlsplit

from bokeh.application import Application
from bokeh.application.application import SessionContext
from bokeh.application.handlers import Handler
from bokeh.document import Document
from bokeh.server.auth_provider import AuthProvider
from bokeh.server.server import Server
from bokeh.server.views.doc_handler import DocHandler
from bokeh.settings import settings
from jinja2 import Environment
from tornado.ioloop import IOLoop
from tornado.web import HTTPError, RequestHandler

from mesoslip.configuration.config import Config
from mesoslip.errors import RunError
from mesoslip.explorer.knobs import with_indices
from mesoslip.explorer.pictures import Measured
from mesoslip.explorer.view import Page

ADDRESS = "127.0.0.1"
# Number of ports that are tried after a port that is in use.
MORE_PORTS = 20
# Time after which the runs of a closed tab are stopped [ms].
UNUSED_MILLISECONDS = 3_000
# Maximum number of pages, as each has its runs; time without a change after which a page is ended
# for a new one, if there are so many [s].
MAX_PAGES = 8
IDLE_SECONDS = 300.0
FULL = f"{MAX_PAGES} pages are open, which is the maximum: close one, and load this one again"

# Bokeh compiles the scripts of its widgets and styles its figures in the page. Everything else is
# refused, and so is everything from other hosts.
POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; connect-src 'self'; "
    "frame-ancestors 'none'; form-action 'none'; base-uri 'none'"
)


def _part(name: str) -> str:
    return files("mesoslip.explorer").joinpath(name).read_text("utf-8")


ENVIRONMENT = Environment(autoescape=False)
ENVIRONMENT.filters["indices"] = with_indices
ENVIRONMENT.globals |= {"style": _part("page.css"), "script": _part("page.js")}
TEMPLATE = ENVIRONMENT.from_string(_part("page.html"))


class Pages(Handler):
    """Builds the page of a new tab, one at a time, on another thread, while the server answers
    other tabs."""

    def __init__(self, config: Config, source: str, trace: Measured | None = None) -> None:
        super().__init__()
        self._config, self._source, self._trace = config, source, trace
        self._turn = asyncio.Lock()
        # By session; None while they are built.
        self._pages: dict[str, Page | None] = {}
        self._contexts: dict[str, SessionContext] = {}

    @property
    def has_room(self) -> bool:
        """Whether there may be one more page; ends one that is idle, if that makes room."""
        if len(self._pages) < MAX_PAGES:
            return True
        now = time.monotonic()
        idle = {
            name: now - page.last_change for name, page in self._pages.items() if page is not None
        }
        longest = max(idle, key=idle.__getitem__, default="")
        if not longest or idle[longest] < IDLE_SECONDS:
            return False
        self._end(longest)
        return True

    def _end(self, name: str) -> None:
        """End a page: its runs now, its session when the connection is closed."""
        page, context = self._pages.pop(name), self._contexts.pop(name)
        if page is not None:
            page.close()
        session = context.session  # type: ignore[attr-defined]
        for connection in list(session._subscribed_connections):
            connection._socket.close(reason="the page was idle, and others were opened")

    async def on_session_created(self, session_context: SessionContext) -> None:
        # A connection may ask for a session without a page.
        if not self.has_room:
            raise RunError(FULL)
        self._pages[session_context.id] = None
        self._contexts[session_context.id] = session_context
        async with self._turn:
            await session_context.with_locked_document(self._build)

    async def on_session_destroyed(self, session_context: SessionContext) -> None:
        self._pages.pop(session_context.id, None)
        self._contexts.pop(session_context.id, None)

    async def _build(self, document: Document) -> None:
        document.template = TEMPLATE
        context = document.session_context
        query = [] if context is None else _query(context)
        page = await asyncio.to_thread(
            Page, document, self._config, self._source, self._trace, query
        )
        if context is not None and context.id in self._pages:
            self._pages[context.id] = page

    def modify_document(self, doc: Document) -> None:
        """Do nothing: the page was built with its session."""


def _query(context: SessionContext) -> list[tuple[str, str]]:
    """The query of the address of a page, in order."""
    request = context.request  # type: ignore[attr-defined]
    arguments = {} if request is None else request.arguments
    return [
        (key, value.decode(errors="replace"))
        for key, values in arguments.items()
        if not key.startswith("bokeh-")
        for value in values[-1:]
    ]


class OnlyHere(AuthProvider):
    """Allows requests of the page itself, under the address of this machine."""

    def __init__(self, pages: Pages) -> None:
        self.hosts: set[str] = set()
        self._pages = pages
        super().__init__()

    @property
    def get_user_async(self) -> Callable[[Any], Awaitable[Any]]:
        return self._user

    @property
    def login_url(self) -> str:
        """There is no login, so a refusal is final."""
        return "/"

    async def _user(self, handler: RequestHandler) -> str:
        headers = handler.request.headers
        origin, site = headers.get("Origin"), headers.get("Sec-Fetch-Site", "none")
        # A foreign name that resolves to this machine is in Host.
        is_allowed = (
            handler.request.host.lower() in self.hosts
            and (origin is None or urlsplit(origin).netloc.lower() in self.hosts)
            and site in {"none", "same-origin"}
        )
        if not is_allowed:
            raise HTTPError(403)
        if isinstance(handler, DocHandler) and not self._pages.has_room:
            raise HTTPError(503, reason=FULL)
        handler.set_header("Content-Security-Policy", POLICY)
        handler.set_header("X-Content-Type-Options", "nosniff")
        # The runs of a page that a browser keeps for its history would continue.
        handler.set_header("Cache-Control", "no-store")
        return "here"


def serve(
    config: Config,
    source: str,
    *,
    trace: Measured | None = None,
    port: int,
    opens: bool,
    report: Callable[[str], None],
) -> None:
    """Serve the page at the first free port from a given one until the program is interrupted, and
    report its address."""
    # Of connections that end in the midst of a message.
    warnings.filterwarnings("ignore", r"coroutine .* was never awaited", RuntimeWarning)
    server = make_server(config, source, port, trace)
    address = f"http://{ADDRESS}:{server.port}/"
    report(address)
    if opens:
        IOLoop.current().call_later(0, webbrowser.open, address)
    server.start()
    try:
        server.io_loop.start()
    finally:
        server.stop()


def make_server(config: Config, source: str, port: int, trace: Measured | None = None) -> Server:
    """A server of the page that is not started; see `serve`."""
    # The garbage collector, which runs after each change, skips objects that exist now.
    gc.collect()
    gc.freeze()

    # Messages of the libraries are for their developers.
    logging.getLogger("bokeh").setLevel(logging.CRITICAL)
    logging.getLogger("tornado").setLevel(logging.CRITICAL)

    # Scripts and styles come from this server, whatever its environment says.
    settings.resources = "server"
    # Tests check the consistency of the models; it is not checked for each tab.
    settings.perform_document_validation = False

    for one in [0] if port == 0 else range(port, port + MORE_PORTS):
        pages = Pages(config, source, trace)
        gate = OnlyHere(pages)
        options: dict[str, Any] = {
            "address": ADDRESS,
            "port": one,
            "auth_provider": gate,
            "allow_websocket_origin": [f"{ADDRESS}:{one}", f"localhost:{one}"],
            "unused_session_lifetime_milliseconds": UNUSED_MILLISECONDS,
            "check_unused_sessions_milliseconds": UNUSED_MILLISECONDS // 3,
        }
        try:
            server = Server({"/": Application(pages)}, **options)
        except OSError:
            continue
        gate.hosts = {f"{name}:{server.port}" for name in (ADDRESS, "localhost")}
        server._tornado.websocket_origins.update(gate.hosts)
        return server
    raise RunError(f"no port from {port} to {port + MORE_PORTS - 1} is free: choose one by --port")
