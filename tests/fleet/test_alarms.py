"""Who is told of an alarm: once, whatever stands in the way."""

from __future__ import annotations

import json
import threading
from dataclasses import replace
from email import message_from_bytes, policy
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.fleet_stand_in import arrive, at_once, made_fleet

from gearmon.fleet import acknowledge, alarms, deliver, run_fleet, watch_fleet
from gearmon.fleet.ledger import _targets, episodes


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    monkeypatch.setattr("gearmon.fleet.ledger._AGAIN_S", (0.0, 0.0, 0.0))


def worn(folder, hooks):
    """A fleet whose machine a is worn when it works in maize."""
    fleet = made_fleet(folder, ("a", "b"), hooks, per_machine='tags = ["old"]')
    for day in range(2):
        arrive(folder, "a_{}_maize.txt", "fault 0.1", days=day)
        arrive(folder, "b_{}_maize.txt", "0.1", days=day)
    run_fleet(fleet, at_once)
    return fleet


def test_a_command_gets_the_alarm_once(tmp_path):
    told = tmp_path / "told.json"
    fleet = worn(tmp_path, f'[[alarm]]\ncommand = ["tee", "-a", "{told}"]')
    assert deliver(fleet) == []
    assert deliver(fleet) == []
    alarm = json.loads(told.read_text())
    assert alarm["machine"] == "a"
    assert alarm["class"] == "maize"
    assert alarm["tags"] == ["old"]


def test_a_webhook_is_tried_again(tmp_path):
    bodies = []

    class Receiver(BaseHTTPRequestHandler):
        def do_POST(self):
            bodies.append(self.rfile.read(int(self.headers["Content-Length"])))
            self.send_response(500 if len(bodies) < 3 else 204)
            self.end_headers()

        def log_message(self, *_):
            pass

    with HTTPServer(("127.0.0.1", 0), Receiver) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        url = f"http://127.0.0.1:{server.server_port}/"
        # a test that fails must not leave a server that keeps the tests from ending
        try:
            fleet = worn(tmp_path, f'[[alarm]]\nwebhook = "{url}"')
            assert deliver(fleet) == []
        finally:
            server.shutdown()
            thread.join()
    assert len(bodies) == 3
    assert json.loads(bodies[2])["finding"] == "wear, stage 1, pinion"


def test_mail_goes_through_sendmail(tmp_path, monkeypatch):
    (tmp_path / "bin").mkdir()
    mailer, letter = tmp_path / "bin" / "sendmail", tmp_path / "letter"
    mailer.write_text(f"#!/bin/sh\ncat > {letter}\n")
    mailer.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}/bin:/usr/bin:/bin")
    fleet = worn(tmp_path / "fleet", '[[alarm]]\nmail = ["farm@example.org"]')
    assert deliver(fleet) == []
    assert "To: farm@example.org" in letter.read_text()
    assert "wear, stage 1, pinion" in letter.read_text()


def test_a_letter_has_one_subject_whatever_machines_are_called(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    fleet = worn(tmp_path, '[[alarm]]\nmail = ["farm@example.org"]')
    (alarm,) = alarms(fleet)
    ((_, send),) = _targets(fleet.hooks[0], fleet.machines[0], alarm | {"machine": "a\nBcc: b"})
    with pytest.raises(FileNotFoundError, match="sendmail"):
        send()


def test_every_way_of_telling_tells_the_same_alarm(tmp_path, monkeypatch):
    sent = {}
    monkeypatch.setattr("gearmon.fleet.ledger._run", lambda words, told: sent.update({words: told}))
    monkeypatch.setattr("gearmon.fleet.ledger._post", lambda url, told: sent.update({url: told}))
    ways = {"command": ["a", "b"], "webhook": "http://c/", "mail": ["d@e.org", "f@g.org"]}
    hook = "".join(f"{way} = {json.dumps(own)}\n" for way, own in ways.items())
    fleet = worn(tmp_path, f"[[alarm]]\n{hook}")
    (alarm,) = alarms(fleet)
    keys = ("machine", "class", "finding", "since")
    body = {key: alarm[key] for key in keys}
    expected = {"machine": "a", "class": "maize", "finding": "wear, stage 1, pinion"}
    assert body == expected | {"since": "2026-03-01T00:00:00Z"}
    told = []
    for name, send in _targets(fleet.hooks[0], fleet.machines[0], alarm):
        send()
        told.append(name)
    names = ["command a", "webhook http://c/", "mail d@e.org", "mail f@g.org"]
    assert told == names
    assert json.loads(sent["a", "b"]) == json.loads(sent["http://c/"]) == body | {"tags": ["old"]}
    # the last letter, for both go to one program
    letter = message_from_bytes(sent["sendmail", "-t", "-oi"], policy=policy.default)
    assert letter["To"] == "f@g.org"
    assert letter["Subject"] == "a: wear, stage 1, pinion"
    lines = dict(line.split(": ", 1) for line in letter.get_content().splitlines())
    assert lines == body


@pytest.mark.parametrize("way", ["over", "acknowledged", "left", "told", "stands"])
def test_of_an_alarm_is_told_while_it_stands_and_nobody_knows_of_it(tmp_path, way):
    told = tmp_path / "told"
    fleet = worn(tmp_path, f'[[alarm]]\ncommand = ["tee", "{told}"]')
    if way == "over":
        for day in range(2, 5):
            arrive(tmp_path, "a_{}_maize.txt", "0.1", days=day)
        run_fleet(fleet, at_once)
    elif way == "acknowledged":
        acknowledge(fleet, alarms(fleet)[0]["id"])
    elif way == "left":
        fleet = replace(fleet, machines=fleet.machines[1:])
    elif way == "told":
        deliver(fleet)
        told.unlink()
    (alarm,) = alarms(fleet)
    assert alarm["over"] == (way == "over")
    assert deliver(fleet) == []
    assert told.exists() == (way == "stands")


def test_one_who_cannot_be_told_is_tried_for_one_alarm_only(tmp_path, monkeypatch):
    fleet = worn(tmp_path, '[[alarm]]\nwebhook = "http://127.0.0.1:9/"')
    for day in range(2):
        arrive(tmp_path, "b_{}.txt", "fault 0.1", days=10 + day)
    run_fleet(fleet, at_once)
    assert len(alarms(fleet)) == 2
    tried = []
    monkeypatch.setattr("gearmon.fleet.ledger._post", lambda *_: tried.append(1) or refuse())
    (told,) = deliver(fleet)
    assert told.startswith("webhook http://127.0.0.1:9/: could not be told of an alarm (no")
    assert len(tried) == 4


def refuse():
    raise OSError("nobody\nlistens")


def test_watching_goes_on_while_a_hook_hangs(tmp_path, monkeypatch):
    fleet = worn(tmp_path, '[[alarm]]\ncommand = ["sleep"]')
    arrive(tmp_path, "a_{}.txt", "0.1", days=20)
    held, looks = threading.Event(), []
    monkeypatch.setattr("gearmon.fleet.ledger._run", lambda *_: held.wait(20.0))

    def told(what):
        looks.append(what.done)
        held.set()

    watch_fleet(fleet, at_once, every_s=0.01, told=told, rounds=2)
    assert looks == [1]


def test_what_cannot_be_told_is_said_and_tried_at_the_next_look(tmp_path):
    fleet = worn(tmp_path, '[[alarm]]\ncommand = ["false"]')
    assert "could not be told" in deliver(fleet)[0]
    assert len(deliver(fleet)) == 1
    acknowledge(fleet, alarms(fleet)[0]["id"])
    assert deliver(fleet) == []


@pytest.mark.parametrize("rule", ['tags = ["new"]', 'classes = ["grass"]'])
def test_hooks_are_told_of_their_own_machines_and_classes(tmp_path, rule):
    fleet = worn(tmp_path, f'[[alarm]]\ncommand = ["false"]\n{rule}')
    assert deliver(fleet) == []


def test_without_a_rule_two_recordings_raise_an_alarm_and_three_end_it(tmp_path):
    fleet, stands = made_fleet(tmp_path, ("a",)), []
    for day, text in enumerate(("fault 0.1", "fault 0.1", "0.1", "0.1", "0.1")):
        arrive(tmp_path, "a_{}.txt", text, days=day)
        run_fleet(fleet, at_once)
        stands.append([own["over"] for own in alarms(fleet)])
    assert stands == [[], [False], [False], [False], [True]]


def test_the_newest_alarm_is_first(tmp_path):
    fleet = made_fleet(tmp_path, ("a", "b", "c"))
    for name, begin in (("a", 3), ("b", 8), ("c", 5)):
        for day in range(begin, begin + 2):
            arrive(tmp_path, name + "_{}.txt", "fault 0.1", days=day)
    run_fleet(fleet, at_once)
    assert [own["machine"] for own in alarms(fleet)] == ["b", "c", "a"]
    since = [own["since"] for own in alarms(fleet)]
    assert since == [f"2026-03-{day:02d}T00:00:00Z" for day in (9, 6, 4)]
    assert [own["machine"] for own in alarms(fleet, "c")] == ["c"]


def test_one_that_begins_earlier_after_a_late_recording_is_the_same_alarm(tmp_path):
    fleet = worn(tmp_path, '[[alarm]]\ncommand = ["true"]')
    deliver(fleet)
    arrive(tmp_path, "a_2026-02-20_maize.txt", "fault 0.1")
    run_fleet(fleet, at_once)
    (alarm,) = alarms(fleet)
    assert alarm["since"] == "2026-02-20T00:00:00Z"
    assert alarm["told"] == ["command true"]


@given(st.lists(st.integers(1, 6), max_size=9), st.integers(1, 4), st.integers(1, 4))
def test_alarms_begin_and_end_where_streaks_do(lengths, after, clear):
    # streaks without and with it, in turn
    found = [bool(n % 2) for n, length in enumerate(lengths) for _ in range(length)]
    rows = [(float(t), {"wear"} if there else set()) for t, there in enumerate(found)]
    told = list(episodes(rows, after, clear))
    # told apart by a slow and obvious automaton
    expected, since, streak = [], None, 0
    for t, there in enumerate(found):
        streak = streak + 1 if there == (since is None) else 0
        if since is None and streak == after:
            since, streak = t - after + 1, 0
        elif since is not None and streak == clear:
            expected.append(("wear", since, t - clear + 1))
            since, streak = None, 0
    expected += [("wear", since, None)] if since is not None else []
    assert told == expected
