"""The fleet as local web pages, made on the server: who needs somebody today, and why.

A machine's page has the charts of the report, zoomed into by a script of its own; no other page has
one. Acknowledging is a form, and the overview asks for itself again every minute: no library of
scripts is needed for these. The report of a recording brings its own policy.
"""

from __future__ import annotations

import hmac
import secrets
import tempfile
import threading
from collections import Counter
from collections.abc import Sequence
from functools import lru_cache
from operator import itemgetter
from pathlib import Path
from statistics import median
from typing import Any
from urllib.parse import urlencode

import uvicorn
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.base import BaseHTTPMiddleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route

from gearmon.diagnosis.history.store import as_text, opened, read_history, read_latest
from gearmon.diagnosis.history.trends import HistoryTrends, history_trends
from gearmon.errors import ArgumentError, GearmonError
from gearmon.fleet.ledger import acknowledge, alarms, compare, recorded, writing
from gearmon.fleet.plan import Fleet, FleetMachine, arrived
from gearmon.fleet.run import at_hand, judged
from gearmon.report import wording
from gearmon.report.html import history_charts, write_report
from gearmon.report.text import WORST_FIRST, history_lines, moment_text

LOOPBACK = ("127.0.0.1", "localhost", "::1")
#: Machines and recordings that a page shows unless it is asked for all.
_SHOWN, _RECORDINGS = 200, 60
_POLICY = (
    "default-src 'none'; style-src 'self'; img-src 'self'; form-action 'self'; base-uri 'none'; "
    "frame-ancestors 'none'"
)
_COOKIE = "gearmon"
#: The verdict on a machine that has no recording yet.
_UNHEARD = "not heard yet"
# Differences from other machines of its kind that a page shows.
_DIFFERENCES = 5
# Highest score of a sparkline: beyond, a fault is a fault.
_HIGHEST_SCORE = 8.0
# pictures are drawn one at a time: matplotlib knows no threads
_DRAWING = threading.Lock()


def application(fleet: Fleet, *, token: str = "", hosts: Sequence[str] = LOOPBACK) -> Starlette:
    """Return the pages of a fleet as an ASGI application.

    Parameters
    ----------
    fleet : Fleet
    token : str
        Whoever asks has to know it; "": nobody is asked.
    hosts : sequence of str
        Names under which the pages may be asked for.
    """
    with writing(fleet):
        pass  # from here on there is a store, if an empty one
    site = _Site(fleet)

    async def guarded(request: Request, call_next: Any) -> Response:
        answer: Response = _refused(request, token) or await call_next(request)
        answer.headers.setdefault("Content-Security-Policy", _POLICY)
        answer.headers.update(
            {"X-Content-Type-Options": "nosniff", "Referrer-Policy": "same-origin"}
        )
        return answer

    def told(_: Request, error: Exception) -> Response:
        return PlainTextResponse(f"{wording.printable(str(error))}\n", 404)

    pages: dict[str, Any] = {
        "/": site.overview,
        "/machine": site.machine,
        "/history.png": site.picture,
        "/recording": site.recording,
        "/table.csv": site.table,
        "/fleet.css": site.style,
        "/charts.js": site.script,
    }
    routes = [Route(path, page) for path, page in pages.items()]
    return Starlette(
        routes=[*routes, Route("/acknowledge", site.acknowledge, methods=["POST"])],
        middleware=[
            Middleware(TrustedHostMiddleware, allowed_hosts=list(hosts)),
            Middleware(BaseHTTPMiddleware, dispatch=guarded),
        ],
        exception_handlers={GearmonError: told},
    )


def _refused(request: Request, token: str) -> Response | None:
    """Refuse those who do not know the token, and forms that another site has sent."""
    origin = request.headers.get("origin")
    if request.method == "POST" and origin != str(request.base_url).rstrip("/"):
        return PlainTextResponse("this form is not of this page\n", 403)
    if not token:
        return None
    given = request.query_params.get("token", "")
    if hmac.compare_digest(given.encode(), token.encode()):
        answer = RedirectResponse(request.url.remove_query_params("token"), 303)
        answer.set_cookie(_COOKIE, token, httponly=True, samesite="strict")
        return answer
    known = request.cookies.get(_COOKIE, "")
    if hmac.compare_digest(known.encode(), token.encode()):
        return None
    return PlainTextResponse("add ?token=... to the address, as gearmon fleet serve says\n", 403)


class _Site:
    """The pages; each is a method that answers a request."""

    def __init__(self, fleet: Fleet) -> None:
        known: dict[str, Any] = {"query": lambda **parts: urlencode(parts), "moment": moment_text}
        self.fleet = fleet
        self.template = wording.template("fleet.html", "gearmon.fleet", **known)

    def _page(self, kind: str, **content: Any) -> Response:
        answer = HTMLResponse(self.template.render(kind=kind, fleet=self.fleet, **content))
        if content.get("charts"):
            answer.headers["Content-Security-Policy"] = f"{_POLICY}; script-src 'self'"
        return answer

    def overview(self, request: Request) -> Response:
        rows = self._rows()
        verdicts = Counter(row["verdict"] for row in rows)
        return self._page(
            "overview",
            rows=rows if "all" in request.query_params else rows[:_SHOWN],
            total=len(rows),
            counts={word: verdicts[word] for word in (_UNHEARD, *WORST_FIRST) if verdicts[word]},
            points=_points,
            alarms=[own for own in alarms(self.fleet) if not own["over"]],
        )

    def _rows(self) -> list[dict[str, Any]]:
        """Return what was last heard of every machine, the worst first."""
        latest = {own["machine"]: own for own in read_latest(self.fleet.store)}
        waiting = {own["machine"] for own in alarms(self.fleet) if not own["over"]}
        rows = [_row(own, latest.get(own.name), own.name in waiting) for own in self.fleet.machines]
        return sorted(rows, key=itemgetter("urgency"))

    def machine(self, request: Request) -> Response:
        machine = self._named(request)
        rows = self._ledger(machine.name)
        done = [row for row in rows if row["state"] == "done"]
        found, charts = _trends(self.fleet, machine, len(rows)), ""
        if found.history.entries:
            classes = {row["time_s"]: row["class"] for row in done}
            charts = wording.as_data({"history": history_charts(found, classes)})
        lines, points = history_lines(found), []
        # what each operating class was heard at, and what was found
        for name in sorted({row["class"] for row in done}):
            own = [row for row in done if row["class"] == name]
            speeds = [60 * row["speed_hz"] for row in own]
            told = {"class": name, "recordings": len(own), "latest": own[0]["verdict"]}
            told |= {"low": min(speeds), "high": max(speeds)}
            told["score"] = median(row["score"] for row in own)
            points.append(told | {"faults": sum(row["verdict"] == "fault" for row in own)})
        return self._page(
            "machine",
            machine=machine,
            row=next(row for row in self._rows() if row["machine"] == machine.name),
            # the recordings themselves stand in a table of their own, with links
            lines=filter(None, lines[lines.index("") :]),
            charts=charts,
            points=points,
            beside=_beside(self.fleet, machine, len(rows)),
            rows=rows if "all" in request.query_params else rows[:_RECORDINGS],
            total=len(rows),
            alarms=alarms(self.fleet, machine.name),
        )

    def picture(self, request: Request) -> Response:
        machine = self._named(request)
        found = _trends(self.fleet, machine, len(self._ledger(machine.name)))
        return Response(_drawn(found), media_type="image/png")

    def recording(self, request: Request) -> Response:
        number = request.query_params.get("id", "")
        rows = self._ledger(None, int(number) if number.isdecimal() else 0)
        machine = self.fleet.machine(rows[0]["machine"]) if rows else None
        if machine is None:
            raise ArgumentError("there is no such recording")
        path = rows[0]["path"]
        # names of files that are no text are kept in another form
        there = next((j.path for j in arrived(self.fleet)[0] if as_text(j.path) == path), path)
        text = _report(self.fleet, machine, there, rows[0]["hash"])
        # the policy of the report stands in its head: its own script, and nothing else
        policy = {"Content-Security-Policy": "frame-ancestors 'none'"}
        return HTMLResponse(text, headers=policy)

    def table(self, request: Request) -> Response:
        if "machine" in request.query_params:
            told = self._ledger(self._named(request).name)
            kept = ("path", "class", "time_s", "state", "why", "verdict", "score", "findings")
            more = dict.fromkeys(name for row in told for name in row["indicators"])
            told = [row | {name: row["indicators"].get(name) for name in more} for row in told]
        else:
            told, more = self._rows(), {}
            kept = ("machine", "verdict", "since", "heard", "finding", "loss", "margin", "alarm")
        text = wording.rows_as_csv([{name: row[name] for name in (*kept, *more)} for row in told])
        headers = {"Content-Disposition": 'attachment; filename="fleet.csv"'}
        return Response(text, headers=headers, media_type="text/csv")

    def style(self, _: Request) -> Response:
        text = f"{wording.report_style()}\n{wording.shipped('fleet.css', 'gearmon.fleet')}"
        return Response(text, media_type="text/css")

    def script(self, _: Request) -> Response:
        return Response(wording.chart_script(), media_type="text/javascript")

    def acknowledge(self, request: Request) -> Response:
        number = request.query_params.get("id", "")
        if number.isdecimal():
            acknowledge(self.fleet, int(number))
        machine = request.query_params.get("machine")
        back = f"/machine?{urlencode({'name': machine})}" if machine else "/"
        return RedirectResponse(back, 303)

    def _named(self, request: Request) -> FleetMachine:
        name = request.query_params.get("name", request.query_params.get("machine", ""))
        machine = self.fleet.machine(name)
        if machine is None:
            raise ArgumentError(f"there is no machine {name!r} in this fleet")
        return machine

    def _ledger(self, machine: str | None, number: int = 0) -> list[dict[str, Any]]:
        """Return the recordings of a machine, the newest first, or the one of this number."""
        with opened(self.fleet.store, create=False) as store:
            order = "machine = ? OR id = ? ORDER BY time_s DESC"
            rows = recorded(store, order, (machine, number))
        return [row | {"findings": "; ".join(row["findings"])} for row in rows]


def _row(machine: FleetMachine, latest: dict[str, Any] | None, alarm: bool) -> dict[str, Any]:
    """Return what the overview says of a machine, and what makes it more urgent than others."""
    row = {"machine": machine.name, "alarm": alarm, "verdict": _UNHEARD, "score": 0.0}
    if latest is None:
        row |= dict.fromkeys(("since", "heard", "finding", "loss", "margin"), "") | {"scores": []}
        return row | {"urgency": (len(WORST_FIRST), not alarm, 0.0, 0.0)}
    loss, low, high = (latest[name] for name in ("loss", "loss_low", "loss_high"))
    left = [None] * 3
    if loss is not None and machine.limit is not None:
        left = [machine.limit - own for own in (loss, high, low)]
    place = WORST_FIRST.index(latest["verdict"])
    return row | {
        "verdict": latest["verdict"],
        "since": moment_text(latest["since_s"]),
        "heard": moment_text(latest["time_s"]),
        "finding": "; ".join(latest["findings"][:1]),
        "loss": wording.loss_text(loss, low, high),
        "margin": wording.loss_text(*left),
        "score": latest["score"],
        "scores": latest["scores"],
        "urgency": (place, not alarm, -(loss or 0.0), -latest["score"]),
    }


def _points(scores: Sequence[float]) -> str:
    """Return a sparkline of 90 by 20 units as the points of an SVG polyline."""
    step = 88.0 / max(1, len(scores) - 1)
    heights = (19 - 18 * min(max(score, 0.0), _HIGHEST_SCORE) / _HIGHEST_SCORE for score in scores)
    return " ".join(f"{1 + step * n:.1f},{y:.1f}" for n, y in enumerate(heights))


@lru_cache(maxsize=32)
def _trends(fleet: Fleet, machine: FleetMachine, _recordings: int) -> HistoryTrends:
    """Follow a machine through its history; anew once there are other recordings."""
    return history_trends(read_history(fleet.store, machine.name), limit=machine.limit)


@lru_cache(maxsize=32)
def _beside(fleet: Fleet, machine: FleetMachine, _recordings: int) -> list[dict[str, Any]]:
    """Return where a machine differs most from others of its kind; anew as it is heard again."""
    try:
        rows = [row for row in compare(fleet, machine) if row["machine"] == machine.name]
    except ArgumentError:  # it has too few of them
        return []
    return rows[:_DIFFERENCES]


@lru_cache(maxsize=16)
def _drawn(found: HistoryTrends) -> bytes:
    from gearmon.report.plots import as_png

    with _DRAWING:
        return as_png(found.figures()[""])


@lru_cache(maxsize=16)
def _report(fleet: Fleet, machine: FleetMachine, path: str, _content: str) -> str:
    """Make the interactive report of a recording, anew once its content is another."""
    history = history_trends(read_history(fleet.store, machine.name), limit=machine.limit)
    with at_hand(path) as file, tempfile.TemporaryDirectory() as folder, _DRAWING:
        analysis, recording, reference, own = judged(machine, file, path)
        target = Path(folder) / "report.html"
        write_report([analysis], [recording], reference, own, target, history=history)
        return target.read_text("utf-8")


def serve(fleet: Fleet, host: str = "127.0.0.1", port: int = 8765, token: str = "") -> None:
    """Serve the pages until stopped.

    Parameters
    ----------
    fleet : Fleet
    host : str
        Address to listen at; on others than those of this computer a token is asked for.
    port : int, 1 to 65535
    token : str
        By default one is made up, if need be; the address that is printed holds it.
    """
    own = host in LOOPBACK
    token = token or ("" if own else secrets.token_urlsafe(16))
    app = application(fleet, token=token, hosts=LOOPBACK if own else ["*"])
    query = f"?{urlencode({'token': token})}" if token else ""
    print(f"{fleet.name}: http://{host}:{port}/{query} (Ctrl-C stops)", flush=True)
    uvicorn.run(app, host=host, port=port, log_level="warning", access_log=False)
