"""The address of the page, for this machine and this browser only."""

from __future__ import annotations

import os
import secrets
import socket
import sys
import threading
import traceback
import webbrowser
from collections.abc import Container, Mapping
from http import HTTPStatus
from pathlib import Path
from typing import Any

from dash import Dash, html
from flask import Flask, Response, redirect, request
from werkzeug.exceptions import HTTPException
from werkzeug.serving import WSGIRequestHandler, make_server

from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import warm_up
from vanedamp.files.errors import shortened
from vanedamp.files.toml_input import InputError
from vanedamp.studies.explore import page, sweep_files
from vanedamp.studies.explore.curves import Submit
from vanedamp.studies.jobs.workers import WorkerPool
from vanedamp.studies.report.motion_page import script_source

HOST = "127.0.0.1"
#: of the workers: the browser draws on the same cores, and first
_NICENESS = 5
#: where the page asks for its callbacks, and bytes of a request: it sends the curves that it shows
_UPDATE, _MOST_BYTES = "/_dash-update-component", 64_000_000
_INDEX = """<!DOCTYPE html>
<html lang="en">
<head>{%metas%}<title>{%title%}</title>{%favicon%}{%css%}</head>
<body>{%app_entry%}<footer>{%config%}{%scripts%}{%renderer%}</footer></body>
</html>"""


def explore_app(
    exploration: page.Exploration | None, sweeps: Mapping[str, Sweep], submit: Submit, apart: Submit | None = None
) -> Dash:
    """Return the page of a scene, of sweeps or of both.

    submit: runs a call in a worker process; apart: the same for the motion at a point, which has no queue to wait in.
    """
    app = Dash(
        "vanedamp", title="vanedamp explore", update_title="", serve_locally=True, index_string=_INDEX,
        assets_folder=str(Path(__file__).with_name("assets")), add_log_handler=False,
    )  # fmt: skip

    def layout() -> html.Div:
        parts = [] if exploration is None else [page.layout(exploration)]
        if sweeps:
            parts.append(html.Main(html.Section(sweep_files.panel(sweeps), className="wide")))
        return html.Div([html.Header([html.H1("vanedamp explore"), html.P(_guide(exploration))]), *parts])

    app.layout = layout
    if exploration is not None:
        page.register(app, exploration, submit, apart or submit)
    if sweeps:
        sweep_files.register(app, sweeps, apart or submit)
    return app


def _guide(exploration: page.Exploration | None) -> str:
    if exploration is None:
        return "Move through the sweeps by the sliders of their axes."
    return (
        "Move a slider (arrow keys work, too) or type a number: the forced response follows. "
        "Click on a point of the curve for its motion."
    )


def guard(app: Dash, port: int, token: str) -> None:
    """Reject requests under another host's name or without the token, and forbid the page all other addresses."""
    hosts, cookie = {f"{name}:{port}" for name in (HOST, "localhost")}, f"vanedamp-{port}"
    server: Flask = app.server
    server.config["MAX_CONTENT_LENGTH"] = _MOST_BYTES
    scripts = " ".join(["'self'", *app.csp_hashes(), script_source()])
    policy = (
        f"default-src 'none'; script-src {scripts}; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
        "font-src 'self' data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )

    @server.before_request
    def check() -> Response | tuple[str, int] | None:
        if request.host not in hosts:  # another name that leads here: DNS rebinding
            return "unknown host\n", HTTPStatus.MISDIRECTED_REQUEST
        given = request.args.get("token")
        if given is not None and secrets.compare_digest(given.encode(), token.encode()):
            answer = redirect("/")
            answer.set_cookie(cookie, token, httponly=True, samesite="Lax")
            return answer  # type: ignore[return-value]
        if not secrets.compare_digest(request.cookies.get(cookie, "").encode(), token.encode()):
            return "open the address that vanedamp has printed, with its token\n", HTTPStatus.FORBIDDEN
        if request.path == _UPDATE and not _well_formed(_body(), app.callback_map):
            return "this is no request of the page\n", HTTPStatus.BAD_REQUEST
        return None

    @server.errorhandler(Exception)
    def fail(error: Exception) -> tuple[str, int] | HTTPException:
        """Describe in a line the error of a request with odd values; a page that fails reports it, too."""
        if isinstance(error, HTTPException):
            return error
        place = traceback.extract_tb(error.__traceback__)[-1]
        told = f"{type(error).__name__}: {error} ({Path(place.filename).name}, line {place.lineno})"
        print(f"vanedamp: explore: a request failed: {shortened(' '.join(told.split()))}", file=sys.stderr, flush=True)
        return "the request failed; the terminal says why\n", HTTPStatus.INTERNAL_SERVER_ERROR

    @server.after_request
    def harden(answer: Response) -> Response:
        answer.headers["Content-Security-Policy"] = policy
        answer.headers["X-Content-Type-Options"] = "nosniff"
        answer.headers["Referrer-Policy"] = "no-referrer"
        answer.headers["Cross-Origin-Resource-Policy"] = "same-origin"
        return answer


def _body() -> Any:
    """Return the data of a request; None for no JSON."""
    try:
        return request.get_json(silent=True)
    except RecursionError:
        return None


def _well_formed(data: Any, callbacks: Container[str]) -> bool:
    """Say whether the body of a request is one of dash's for a callback of the page; the values are checked by that."""
    if not isinstance(data, dict) or not isinstance(data.get("output"), str) or data["output"] not in callbacks:
        return False
    given, changed = [data.get("inputs"), data.get("state", [])], data.get("changedPropIds")
    if not all(isinstance(items, list) for items in given) or not isinstance(changed, list):
        return False
    items = [item for group in given for entry in group for item in (entry if isinstance(entry, list) else [entry])]
    return all(isinstance(name, str) for name in changed) and all(
        isinstance(item, dict) and isinstance(item.get("id"), str | dict) and isinstance(item.get("property"), str)
        for item in items
    )


class _Quiet(WSGIRequestHandler):
    """A handler that keeps connections open and the terminal clean."""

    protocol_version = "HTTP/1.1"

    def log(self, type: str, message: str, *args: object) -> None:
        """Say nothing of requests."""


def serve(
    exploration: page.Exploration | None, sweeps: Mapping[str, Sweep], port: int, count: int, browser: bool
) -> None:
    """Serve the page until Ctrl-C; port: 0 for a free one; count: worker processes. Raises InputError for the port."""
    try:
        listening = socket.create_server((HOST, port))
    except (OSError, OverflowError) as error:
        raise InputError(f"--port: {port} is not to be had ({error}); leave it out for a free one") from None
    token = secrets.token_urlsafe(24)
    with listening, WorkerPool(count, _NICENESS) as pool, WorkerPool(1, _NICENESS) as apart:
        for _ in range(count):
            pool.submit(warm_up)
        port = listening.getsockname()[1]
        app = explore_app(exploration, sweeps, pool.submit, apart.submit)
        guard(app, port, token)
        server = make_server(HOST, port, app.server, threaded=True, request_handler=_Quiet, fd=listening.fileno())
        address = f"http://{HOST}:{port}/?token={token}"
        print(f"{address}\nCtrl-C ends it", flush=True)
        if browser and has_display():
            threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()
        server.serve_forever()
        raise KeyboardInterrupt  # that ends it, and the server has kept it for itself


def has_display() -> bool:
    """Say whether a browser has a window to open; a browser in the terminal would be in its way."""
    return sys.platform in ("darwin", "win32") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
