"""What the server answers: read only, nothing outside the results, and pages that can load nothing from elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from studies.serving.current_table import TableMaker
from studies.serving.pages import LIVE, Pages, digest_of
from studies.serving.site import Site
from studies.serving.watching import FolderWatch, Watch
from studies.storage.folders import REPORT_FILE

ASSETS = Path(__file__).with_name("assets")

_NOTHING = "default-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
# Of a page that the server makes: its script and its style are files.
_OF_LIVE_PAGES = f"{_NOTHING}; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'"
# Of a report, which is a single file that needs no other.
_OF_REPORTS = (
    f"{_NOTHING}; script-src 'unsafe-inline' blob:; style-src 'unsafe-inline'; img-src 'self' data: blob:; "
    "font-src data:; connect-src data: blob:; worker-src blob:"
)
# Of every other file: a picture can contain scripts, too. (The viewer of PDF files does not work in a sandbox.)
_OF_FILES, _OF_PDFS = f"{_NOTHING}; style-src 'unsafe-inline'; sandbox", "frame-ancestors 'none'"

_HEADERS = {
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "cache-control": "no-cache",  # asked for again each time, and sent again only if it has changed
}

# By suffix; the tables of the system differ from one to the next.
_TYPES = {
    ".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".png": "image/png", ".svg": "image/svg+xml",
    ".pdf": "application/pdf", ".json": "application/json", ".csv": "text/csv", ".md": "text/plain",
    ".txt": "text/plain", ".tex": "text/plain", ".yaml": "text/plain", ".jsonl": "text/plain",
}  # fmt: skip


def application(root: Path, hosts: Sequence[str]) -> Starlette:
    """The server of a folder of results.

    Parameters
    ----------
    root : Path
    hosts : sequence of str
        names by which it is asked for, ("*",) for any. Others are refused: a page from elsewhere, whose name has come
        to stand for this machine, reads nothing.
    """
    answers = _Answers(root)
    routes = [
        Route("/", answers.index),
        Route("/-/{name}", answers.asset),
        Route(LIVE + "/{folder:path}", answers.live),
        Route("/{path:path}", answers.file),
    ]
    middleware = [Middleware(_SecurityHeaders), Middleware(TrustedHostMiddleware, allowed_hosts=list(hosts))]
    return Starlette(routes=routes, middleware=middleware, exception_handlers={HTTPException: _refuse})


class _Answers:
    """The answers to GET; those to HEAD are the same without their text, and nothing else is answered."""

    def __init__(self, root: Path) -> None:
        self._site = Site(root)
        self._pages = Pages(self._site)
        self._watch = Watch(root, self._site.contains)
        self._makers: dict[FolderWatch, TableMaker] = {}

    async def index(self, request: Request) -> Response:
        """All studies."""
        text = await run_in_threadpool(lambda: self._pages.index(self._watch.folders()))
        return _page(text, request)

    async def asset(self, request: Request) -> Response:
        """The script or the style of the pages."""
        path = ASSETS / request.path_params["name"]
        if path.parent != ASSETS or path.suffix not in (".js", ".css") or not path.is_file():
            raise HTTPException(404)
        return _file(path, request)

    async def live(self, request: Request) -> Response:
        """One study as it is now."""
        return await run_in_threadpool(self._live, request)

    async def file(self, request: Request) -> Response:
        """A file; of a study without a report, the page of the study in its place."""
        return await run_in_threadpool(self._file, request)

    def _live(self, request: Request) -> Response:
        path = self._site.find(_raw_path(request).removeprefix(LIVE.encode()))
        watch = self._watch.folder(path) if path else None
        if watch is None:
            raise HTTPException(404)
        return self._live_page(watch, request)

    def _file(self, request: Request) -> Response:
        raw = _raw_path(request)
        folder, _, name = raw.rpartition(b"/")
        path = self._site.find(raw)
        if path is None and name == REPORT_FILE.encode():  # it has not been written yet
            watch = self._watch_of(folder)
            if watch is not None:
                return self._live_page(watch, request)
        elif path is not None and path.is_dir():
            watch = self._watch.folder(path)
            if watch is not None:
                return self._folder(watch, raw, request)
        elif path is not None and name and path.is_file():
            return _file(path, request)
        raise HTTPException(404)

    def _folder(self, watch: FolderWatch, raw: bytes, request: Request) -> Response:
        """The report of a study, or its live page."""
        if not raw.endswith(b"/"):
            return RedirectResponse(self._site.href(watch.folder) + "/")
        report = self._site.find(raw + REPORT_FILE.encode())
        return _file(report, request) if report and report.is_file() else self._live_page(watch, request)

    def _watch_of(self, raw_folder: bytes) -> FolderWatch | None:
        path = self._site.find(raw_folder)
        return self._watch.folder(path) if path else None

    def _live_page(self, watch: FolderWatch, request: Request) -> Response:
        maker = self._makers.setdefault(watch, TableMaker(watch))
        return _page(self._pages.study(watch, maker.latest()), request)


class _SecurityHeaders:
    """Adds headers to every answer."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                present = {name for name, _ in message["headers"]}
                added = {"content-security-policy": _OF_FILES} | _HEADERS
                message["headers"] = [
                    *message["headers"],
                    *((name.encode(), value.encode()) for name, value in added.items() if name.encode() not in present),
                ]
            await send(message)

        await self._app(scope, receive, send_with_headers)


def _raw_path(request: Request) -> bytes:
    """The path of the address as it was sent, without what follows a question mark."""
    return bytes(request.scope["raw_path"]).partition(b"?")[0]


def _page(text: str, request: Request) -> Response:
    """A page that the server has made; nothing but its headers if the browser has it."""
    headers = {"etag": digest_of(text), "content-security-policy": _OF_LIVE_PAGES}
    if headers["etag"] in request.headers.get("if-none-match", ""):
        return Response(status_code=304, headers=headers)
    return HTMLResponse(text, headers=headers)


def _file(path: Path, request: Request) -> Response:
    """A file; nothing but its headers if the browser has it."""
    kind = _TYPES.get(path.suffix.lower(), "application/octet-stream")
    policy = {"text/html": _OF_REPORTS, "application/pdf": _OF_PDFS}.get(kind, _OF_FILES)
    response = FileResponse(path, media_type=kind, stat_result=path.stat(), headers={"content-security-policy": policy})
    if response.headers["etag"] in request.headers.get("if-none-match", ""):
        # The browser replaces the headers that it has kept by these: the policy must be the same.
        kept = {name: response.headers[name] for name in ("etag", "content-security-policy")}
        return Response(status_code=304, headers=kept)
    return response


async def _refuse(request: Request, error: Exception) -> Response:
    """The reason in one line; never a path of this machine."""
    assert isinstance(error, HTTPException)
    return PlainTextResponse(f"{error.status_code} {error.detail}\n", error.status_code, headers=error.headers)


__all__ = ["application"]
