"""The page of the explorer in a real browser: as it is loaded, used, and closed."""

import http.client
import json
import os
import random
import statistics
import time
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from conftest import PATIENCE, ROOT, Browser, Server, eventually, is_here
from mesoslip import Config
from mesoslip.explorer.controls import BY_KEY, CONTROLS, STEPS
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

REFUSED = 403
# Random changes, and the median time in which they are to be drawn [s].
CHANGES = 200
MEDIAN = 0.5
# What the memory of the program may grow by while it is used, after the first half of the changes.
GROWTH = 1.1


def ask(address: str, path: str = "/", **headers: str) -> int:
    """Status of a request with headers of one's own."""
    connection = http.client.HTTPConnection(urlsplit(address).netloc, timeout=PATIENCE)
    try:
        connection.request(
            "GET", path, headers={k.replace("_", "-"): v for k, v in headers.items()}
        )
        return connection.getresponse().status
    finally:
        connection.close()


def test_loads_and_draws_without_asking_anyone(server, browser):
    browser.open_until_done(server.address)
    asked = browser.requests()
    assert len(asked) > 3
    assert [url for url in asked if not is_here(url)] == []
    assert browser.errors() == []
    force = browser.data("force:this run")
    assert 17.0 < max(force) < 18.0
    assert browser.model("force", "below[0].axis_label") == "time (s)"
    # Theory comes after the picture: first the curve, then what is known of steady sliding.
    assert eventually(lambda: len(browser.data("curve:force")) > 100)
    assert eventually(lambda: "steady sliding" in browser.text("theory"))
    assert "stick-slip" in browser.text("verdict")


def test_a_value_is_typed(server, browser):
    browser.open_until_done(server.address)
    before = browser.data("force:this run")
    field = browser.element("contacts.static_force")
    field.send_keys(Keys.CONTROL, "a", Keys.NULL, "9 uN", Keys.ENTER)
    browser.wait("return document.getElementById('command').textContent.includes('9 uN')")
    browser.wait_until_done()
    assert max(browser.data("force:this run")) == pytest.approx(max(before) / 2, rel=0.02)
    assert "was 18 µN" in browser.was("contacts.static_force")


def test_a_slider_is_moved_by_keys(server, browser):
    browser.open_until_done(server.address)
    handle = browser.element("contacts.delay:slider")
    handle.send_keys(Keys.ARROW_RIGHT)
    browser.wait("return document.getElementById('command').textContent.includes('delay')")
    assert int(browser.value("contacts.delay:slider")) == STEPS / 2 + 1
    browser.wait_until_done()
    assert "● was 500 µs" in browser.was("contacts.delay")
    assert browser.errors() == []


def test_the_picture_follows_a_knob_that_is_being_turned(server, browser):
    """Before it comes to rest, and in the end it is of where the knob is."""
    browser.open_until_done(server.address)
    browser.driver.execute_script(
        """
        window.seen = []
        Bokeh.documents[0].get_model_by_name("sent").properties.tags.change.connect(() =>
          window.seen.push("picture"))
        document.getElementById("slider.stiffness:slider").addEventListener("input", () =>
          window.seen.push("slider"))
        """
    )
    handle = browser.element("slider.stiffness:slider")
    hand = ActionChains(browser.driver, duration=100).click_and_hold(handle)
    for _ in range(20):
        hand.move_by_offset(2, 0)
    hand.release().perform()
    browser.wait_until_done()
    seen = browser.driver.execute_script("return window.seen")
    last = len(seen) - 1 - seen[::-1].index("slider")
    assert seen[:last].count("picture") >= 2
    assert "picture" in seen[last:]
    text = browser.value("slider.stiffness")
    assert f"slider.stiffness={text}" in browser.text("command")
    place = int(browser.value("slider.stiffness:slider"))
    scale = BY_KEY["slider.stiffness"].scale(97.0)
    assert BY_KEY["slider.stiffness"].text(scale.value(place)) == text
    assert browser.errors() == []


def test_what_was_marked_is_not_any_more(server, browser):
    """After all changes are taken back: neither a knob that was changed nor an error."""
    browser.open_until_done(server.address)

    def looks(name, what):
        script = "return getComputedStyle(document.getElementById(arguments[0]))[arguments[1]]"
        return browser.driver.execute_script(script, name, what)

    before = looks("knob:contacts.delay", "backgroundColor"), looks("status", "color")
    assert browser.change("contacts.delay", "1 kg")[1] == "refused"
    marked = looks("knob:contacts.delay", "backgroundColor"), looks("status", "color")
    assert marked[0] != before[0]
    assert marked[1] != before[1]
    browser.element("reset").click()
    browser.wait_until_done()
    assert looks("knob:contacts.delay", "backgroundColor") == before[0]
    assert looks("status", "color") == before[1]


def test_a_program_that_has_ended_is_reported(browser):
    server = Server("runs/klein.toml")
    browser.open(server.address)
    assert not browser.driver.find_element(By.CLASS_NAME, "lost-only").is_displayed()
    server.stop()
    assert eventually(browser.driver.find_element(By.CLASS_NAME, "lost-only").is_displayed)


# Keys that no choice brings: only a file that has them.
OF_A_FILE = {
    "contacts.drag",
    "slider.damping",
    "slider.layer_damping",
    "drive.cycle.frequency",
    "run.drive_displacement",
    "slider.loading",
    "slider.top_stiffness",
}


@pytest.mark.parametrize(
    "control", [one for one in CONTROLS if one.key not in OF_A_FILE], ids=lambda one: one.key
)
def test_each_control_draws_a_new_picture(server, browser, control):
    """Each by itself on a page of its own; what it changes to can be run."""
    browser.open(server.address)
    before = browser.text("command")
    if browser.value(f"knob:{control.key}", "hidden"):
        # The control, and its choice, with which it comes.
        first, choice = next(
            (one.key, choice)
            for one in CONTROLS
            for choice, keys in one.required.items()
            if control.key in keys
        )
        assert browser.change(first, choice)[1] == "drawn"
    if control.is_text:
        assert browser.change(control.key, "2 s at 0.1 um/s; 1 s at 1 um/s")[1] == "drawn"
    elif control.choices:
        now = browser.value(control.key)
        other = next(one for one in control.choices if one != now)
        assert browser.change(control.key, other)[1] == "drawn"
    else:
        place = int(browser.value(f"{control.key}:slider"))
        place = place - 8 if place > STEPS / 2 else place + 8
        assert browser.change(f"{control.key}:slider", place)[1] == "drawn"
        # The page leaves the slider where it was put, to the rounding of the text.
        assert abs(int(browser.value(f"{control.key}:slider")) - place) <= 2
    assert browser.text("command") != before
    assert "●" in browser.was(control.key)
    assert len(browser.data("force:this run")) > 1
    assert browser.errors() == []


def test_a_wrong_value_is_reported_at_its_control(server, browser):
    browser.open_until_done(server.address)
    before = browser.data("force:this run")
    assert browser.change("contacts.delay", "<b>1 kg</b>")[1] == "refused"
    assert "<b>1 kg</b>" in browser.text("contacts.delay:message")
    assert browser.value("contacts.delay", "ariaInvalid") == "true"
    assert browser.data("force:this run") == before
    # The field shows what is run.
    assert browser.value("contacts.delay") == "500 µs"
    assert browser.element("contacts.delay").get_attribute("value") == "500 µs"
    assert browser.change("contacts.delay", "1 ms")[1] == "drawn"
    assert not browser.text("contacts.delay:message")


def test_infinitely_many_contacts_beside(server, browser):
    browser.open(server.address)
    browser.change("run.duration", "3 s")
    assert browser.change("compare")[1] == "drawn"
    limit = "return Bokeh.documents[0].get_model_by_name('force:N → ∞').data.y.length"
    browser.wait(f"{limit} > 100")
    assert "N → ∞" in browser.text("results:head")
    browser.wait_until_done()
    assert eventually(
        lambda: abs(max(browser.data("force:N → ∞")) - max(browser.data("force:this run"))) < 0.5
    )
    assert browser.change("interaction.lattice", "square")[1] == "drawn"
    assert "no neighbours" in browser.text("limit")
    assert browser.data("force:N → ∞") == []


def test_a_link_gives_the_same_picture_and_history_goes_both_ways(server, browser):
    browser.open(server.address)
    assert browser.driver.current_url == server.address
    assert browser.change("contacts.delay", "1 ms")[1] == "drawn"
    assert browser.change("slider.stiffness", "80 N/m")[1] == "drawn"
    browser.wait_until_done()
    link, force = browser.driver.current_url, browser.data("force:this run")
    assert link.endswith("?run=klein&contacts.delay=1+ms&slider.stiffness=80+N/m")
    browser.open_until_done(link)
    assert browser.data("force:this run") == force
    assert browser.value("contacts.delay") == "1 ms"
    assert browser.change("contacts.delay", "2 ms")[1] == "drawn"
    assert browser.change("undo")[1] == "drawn"
    assert browser.value("contacts.delay") == "1 ms"
    browser.driver.find_element(By.TAG_NAME, "body").send_keys(Keys.CONTROL, "y")
    assert eventually(lambda: browser.value("contacts.delay") == "2 ms")
    browser.open(f"{server.address}?contacts.delay=1+kg")
    assert "contacts.delay: has the unit kg" in browser.text("error")
    assert browser.value("contacts.delay") == "500 µs"
    assert browser.errors() == []


def test_a_ready_run_begins_anew_and_a_pinned_curve_stays(server, browser):
    browser.open_until_done(server.address)
    force = browser.data("force:this run")
    browser.element("pin").click()
    assert eventually(lambda: browser.data("force:pinned") == force)
    assert browser.change("contacts.delay", "1 ms")[1] == "drawn"
    assert browser.data("force:pinned") == force
    assert browser.text("pinned").startswith("pinned: contacts.delay = 500 µs")
    assert browser.change("preset", "vibrating-load")[1] == "drawn"
    assert browser.text("heading") == "Sliding under a vibrating load"
    assert browser.driver.current_url.endswith("?run=vibrating-load")
    assert not browser.value("panel:load", "hidden")
    browser.element("pin").click()
    assert eventually(lambda: browser.data("force:pinned") == [])
    assert browser.value("panel:interface", "hidden")
    assert browser.change("preset", "precursors")[1] == "drawn"
    assert not browser.value("panel:interface", "hidden")
    assert eventually(lambda: "ruptures of blocks" in browser.text("described:interface"))
    assert browser.errors() == []


@pytest.mark.parametrize("colours", ["light", "dark"])
def test_nothing_serious_stands_in_the_way_of_anybody(server, browser, colours):
    """By axe-core: of a run, of a refused value, of a lattice, and of a slider without a spring."""
    scheme = [{"name": "prefers-color-scheme", "value": colours}]
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": scheme})
    try:
        browser.open(server.address)
        dark = "return document.documentElement.classList.contains('in-the-dark')"
        assert browser.driver.execute_script(dark) == (colours == "dark")
        browser.wait_until_done()
        browser.element("pin").click()
        assert browser.findings() == []
        assert browser.change("contacts.delay", "1 kg")[1] == "refused"
        assert browser.findings() == []
        for key, value in (("interaction.lattice", "square"), ("slider.kind", "prescribed")):
            assert browser.change(key, value)[1] == "drawn"
            browser.wait_until_done()
            assert browser.findings() == []
            browser.element("undo").click()
    finally:
        browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def test_a_keyboard_reaches_what_a_mouse_does(server, browser):
    """Names, values with units, the meaning of a knob at its focus, and a status that is read."""
    browser.open_until_done(server.address)
    slider = browser.element("contacts.delay:slider")
    assert slider.accessible_name == "delay τd"
    assert slider.aria_role == "slider"
    assert slider.get_attribute("aria-valuetext") == "500 µs"
    assert not browser.element("contacts.delay:help").is_displayed()
    browser.element("contacts.delay").send_keys(Keys.TAB)
    assert browser.driver.switch_to.active_element == slider
    assert "Time between detaching and attaching" in browser.element("contacts.delay:help").text
    assert "contacts.delay" in browser.element("contacts.delay:help").text
    slider.send_keys(Keys.PAGE_UP)
    assert eventually(lambda: slider.get_attribute("aria-valuetext") != "500 µs")
    assert slider.get_attribute("aria-valuetext") == browser.value("contacts.delay")
    browser.wait_until_done()
    assert eventually(lambda: browser.text("announcement").startswith("done. stick-slip"))
    # The pictures in words, and the results as a table.
    assert browser.text("described:force").startswith("this run: spring force from -")
    names = [one.text for one in browser.element("results").find_elements(By.TAG_NAME, "th")]
    assert names[:3] == ["force", "breaks", "slips"]
    assert (
        browser.driver.execute_script(
            "return getComputedStyle(document.activeElement).outlineStyle"
        )
        == "solid"
    )


# Ten knobs, one after another, on pages of two widths.
TEN = (
    ("contacts.delay", "0.7 ms"),
    ("slider.stiffness", "80 N/m"),
    ("slider.damping_ratio", "0.3"),
    ("contacts.count", "3000"),
    ("contacts.static_force", "20 uN"),
    ("contacts.threshold.relative_width", "0.02"),
    ("drive.velocity", "0.2 um/s"),
    ("drive.stage", "2 s at 0.1 um/s; hold 1 s; 1 s at 1 um/s"),
    ("run.duration", "5 s"),
    ("interaction.lattice", "triangular"),
)
WIDE, NARROW = 1280, 420


@pytest.mark.parametrize("width", [WIDE, NARROW])
def test_ten_knobs_at_a_width(server, browser, tmp_path, width):
    """Nothing is wider than the page, and knobs, picture and messages are where a hand gets."""
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    browser.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        browser.open(server.address)
        browser.driver.execute_script(
            "document.querySelectorAll('details').forEach((group) => { group.open = true })"
        )
        for key, value in TEN:
            assert browser.change(key, value)[1] == "drawn", key
            assert "●" in browser.was(key) or key == "drive.velocity", key
        browser.wait_until_done()
        assert "N is kept" in browser.text("interaction.lattice:message")
        assert browser.change("run.engine", "me")[1] == "refused"
        assert browser.value("run.engine") == "eq"
        wide = browser.driver.execute_script(
            "return [document.documentElement.scrollWidth, window.innerWidth]"
        )
        assert wide[0] <= wide[1]
        force, knob = (
            browser.driver.execute_script(
                "const one = document.getElementById(arguments[0]).getBoundingClientRect();"
                "return [one.left, one.right, one.width]",
                name,
            )
            for name in ("panel:force", "knob:contacts.delay")
        )
        for left, right, _ in (force, knob):
            assert 0 <= left < right <= wide[1]
        # Beside each other, or one column.
        assert (knob[1] < force[0]) == (width == WIDE)
        assert force[2] > (450 if width == WIDE else 340)
        if width == NARROW:
            # The picture of the force stays visible while knobs are turned.
            browser.driver.execute_script("window.scrollTo(0, 1500)")
            script = "return document.querySelector('.panel-force').getBoundingClientRect().top"
            assert browser.driver.execute_script(script) == pytest.approx(0, abs=1)
        browser.driver.save_screenshot(str(tmp_path / f"{width}.png"))
        assert browser.errors() == []
    finally:
        browser.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_a_lattice_moves(server, browser):
    browser.open(server.address)
    for key, value in (
        ("interaction.lattice", "triangular"),
        ("contacts.stiffness", "200 N/m"),
        ("contacts.threshold.relative_width", "0.3"),
        ("interaction.strength", "0.3"),
    ):
        assert browser.change(key, value)[1] == "drawn"
    browser.wait_until_done()
    image = "return Bokeh.documents[0].get_model_by_name('lattice:image').data.image[0]"
    browser.wait(f"{image} != null")
    assert browser.model("lattice:image", "data.dw[0]") == 60
    browser.element("moving").click()
    seen = set()
    assert eventually(lambda: seen.add(browser.value("snapshot")) or len(seen) > 3)
    browser.element("moving").click()
    assert eventually(lambda: browser.text("moving") == "play")
    assert browser.errors() == []


def test_two_tabs_have_changes_of_their_own(browser):
    server = Server("runs/klein.toml")
    try:
        browser.open(server.address)
        # Threads start with their first work; theory is the last.
        assert eventually(lambda: "steady sliding" in browser.text("theory"))
        one = server.threads()
        first = browser.driver.current_window_handle
        assert browser.change("contacts.delay", "1 ms")[1] == "drawn"
        browser.driver.switch_to.new_window("tab")
        browser.open(server.address)
        assert browser.value("contacts.delay") == "500 µs"
        assert browser.change("slider.stiffness", "200 N/m")[1] == "drawn"
        assert server.threads() >= one + 2
        browser.driver.close()
        browser.driver.switch_to.window(first)
        assert browser.value("contacts.delay") == "1 ms"
        assert "stiffness" not in browser.text("command")
        assert browser.change("slider.mass", "1 g")[1] == "drawn"
        # A closed tab leaves no thread behind.
        assert eventually(lambda: server.threads() <= one, 60)
    finally:
        server.stop()


def test_a_tab_that_is_closed_ends_its_run(browser, tmp_path):
    """Though that would go on for hours."""
    path = tmp_path / "long.toml"
    path.write_text(
        f'base = "{ROOT}/runs/klein.toml"\n[run]\nduration = "1e5 s"\n'
        '[contacts]\ncount = 1000000\n[output]\ninterval = "1 s"\nslip_interval = "10 ms"\n'
    )
    server = Server(str(path))
    try:
        first = browser.driver.current_window_handle
        browser.driver.switch_to.new_window("tab")
        browser.open(server.address)
        browser.driver.close()
        browser.driver.switch_to.window(first)
        # The server's own, and the one that builds pages.
        assert eventually(lambda: server.threads() <= 2, 60)
    finally:
        server.stop()


def test_pages_that_were_left_leave_nothing(browser):
    """The browser does not keep them for its way back."""
    server = Server("runs/klein.toml")
    memory = []
    try:
        for _ in range(6):
            browser.open_until_done(server.address)
            browser.driver.get("about:blank")
            # The server's own, and the one that builds pages.
            assert eventually(lambda: server.threads() <= 2, 60)
            memory.append(server.memory())
        assert memory[-1] < 1.15 * memory[0], memory
    finally:
        server.stop()


def test_files_are_saved(server, browser, tmp_path):
    import mesoslip

    browser.driver.execute_cdp_cmd(
        "Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path)}
    )
    browser.open(server.address)
    assert browser.change("contacts.delay", "0.4 ms")[1] == "drawn"
    browser.wait_until_done()
    browser.element("save").click()
    assert eventually((tmp_path / "klein.toml").exists)
    saved = Config.load(tmp_path / "klein.toml")
    assert saved == Config.load(ROOT / "runs" / "klein.toml", ["contacts.delay=0.4 ms"])
    browser.element("download").click()
    assert eventually((tmp_path / "klein.nc").exists)
    tree = mesoslip.open_output(tmp_path / "klein.nc")
    assert float(tree["spring_force"].max()) == pytest.approx(
        1e-6 * max(browser.data("force:this run")), rel=1e-3
    )


def test_a_movie_is_saved(server, browser, tmp_path):
    browser.driver.execute_cdp_cmd(
        "Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path)}
    )
    browser.open(server.address)
    for key, value in (("run.duration", "2.2 s"), ("contacts.count", "400")):
        assert browser.change(key, value)[1] == "drawn"
    browser.element("movie").click()
    assert eventually((tmp_path / "klein.gif").exists, PATIENCE)
    assert (tmp_path / "klein.gif").read_bytes().startswith(b"GIF8")
    assert browser.change("run.engine", "me")[1] == "drawn"
    # What the run reports at its end would replace the message.
    browser.wait_until_done()
    browser.element("movie").click()
    assert eventually(lambda: "engine" in browser.text("status"))
    assert browser.errors() == []


def test_a_measured_trace_lies_beside_the_model(browser, tmp_path):
    import mesoslip

    trace = tmp_path / "trace.nc"
    mesoslip.run(Config.load(ROOT / "runs" / "klein.toml", ["contacts.delay=1 ms"])).to_netcdf(
        trace
    )
    server = Server("runs/klein.toml", "--trace", str(trace))
    try:
        browser.open_until_done(server.address)
        measured, force = browser.data("force:measured"), browser.data("force:this run")
        assert 17.0 < max(measured) < 18.0
        assert measured != force
        assert "(measured " in browser.text("results")
        # The same parameters, the same motion.
        assert browser.change("contacts.delay", "1 ms")[1] == "drawn"
        browser.wait_until_done()
        assert browser.data("force:measured") == measured
        assert max(browser.data("force:this run")) == pytest.approx(max(measured), rel=1e-3)
        assert browser.errors() == []
    finally:
        server.stop()


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example"},
        {"Host": "evil.example:5006"},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "same-site"},
    ],
    ids=str,
)
@pytest.mark.parametrize("path", ["/", "/ws", "/autoload.js?bokeh-autoload-element=x"])
def test_other_origins_are_refused(server, headers, path):
    upgrade = {
        "Upgrade": "websocket",
        "Connection": "Upgrade",
        "Sec_WebSocket_Version": "13",
        "Sec_WebSocket_Key": "AAAAAAAAAAAAAAAAAAAAAA==",
    }
    # A file, as pages that are asked for without a browser stay open for seconds.
    assert ask(server.address, "/static/js/bokeh.min.js") == 200
    assert ask(server.address, path, **headers, **(upgrade if path == "/ws" else {})) == REFUSED


def test_another_page_cannot_reach_it(server, browser):
    """A page of another origin, in the same browser, gets no connection."""
    browser.driver.get("data:text/html,<title>another page</title>")
    outcome = browser.driver.execute_async_script(
        """
        const done = arguments[arguments.length - 1]
        const socket = new WebSocket(arguments[0].replace("http", "ws") + "ws", ["bokeh", "x"])
        socket.onopen = () => done("open")
        socket.onerror = () => done("refused")
        """,
        server.address,
    )
    assert outcome == "refused"


def test_only_this_machine_is_listened_to(server):
    port = urlsplit(server.address).port
    table = Path(f"/proc/{server.process.pid}/net/tcp").read_text().splitlines()
    # Its sockets: those that other pages of a test are connected to have the same address.
    bound = [line.split()[1] for line in table if line.split()[1].endswith(f":{port:04X}")]
    assert bound
    assert {one.split(":")[0] for one in bound} == {"0100007F"}


def test_files_cannot_be_asked_for(server):
    for path in ("/static/../../../etc/passwd", "/runs/klein.toml", "/static/%2e%2e/%2e%2e/x"):
        assert ask(server.address, path) in {403, 404}


# As long as a machine with other work on it may take.
@pytest.mark.timeout(1800)
def test_many_changes_at_random():
    """No error, new pictures soon, memory that does not grow."""
    chance = random.Random(1)
    server, browser = Server("runs/klein.toml"), Browser()
    try:
        browser.open_until_done(server.address)
        first = browser.text("command")
        drawn, refused, memory, before = [], 0, [], server.computing_time()
        for number in range(CHANGES):
            keys = browser.driver.execute_script(
                """
                const find = (key) => document.getElementById(`knob:${key}`)
                return arguments[0].filter((key) => !find(key).hidden)
                """,
                [one.key for one in CONTROLS],
            )
            shown = [one for one in CONTROLS if one.key in keys and not one.is_text]
            control = chance.choice(shown)
            if control.choices:
                options = browser.driver.execute_script(
                    "return Array.from(document.getElementById(arguments[0]).options)"
                    ".filter((one) => !one.hidden).map((one) => one.value)",
                    control.key,
                )
                now = browser.value(control.key)
                value = chance.choice([one for one in options if one != now])
                seconds, became = browser.change(control.key, value)
            else:
                name = f"{control.key}:slider"
                now = int(browser.value(name))
                value = chance.choice([one for one in range(STEPS + 1) if abs(one - now) > 5])
                seconds, became = browser.change(name, value)
            assert became in {"drawn", "refused"}, control.key
            if became == "drawn":
                drawn.append(seconds)
            else:
                refused += 1
                # What is shown is as it was.
                assert str(now) == browser.value(control.key if control.choices else name)
            assert browser.errors() == []
            if number % 25 == 24:
                # Runs differ in size: memory is compared with the same one shown.
                browser.element("reset").click()
                browser.wait(
                    "return document.getElementById('command').textContent == arguments[0]",
                    first,
                )
                browser.wait_until_done()
                memory.append(server.memory())
        summary = {
            "drawn": len(drawn),
            "refused": refused,
            "median": statistics.median(drawn),
            "90 %": float(np.percentile(drawn, 90)),
            "longest": max(drawn),
            "memory": [round(one / 1e6) for one in memory],
            "server's computing time": (server.computing_time() - before) / CHANGES,
            "load": os.getloadavg()[0],
        }
        print(json.dumps(summary))
        assert max(memory[4:]) < GROWTH * max(memory[:4]), summary
        assert summary["median"] < MEDIAN, summary
    finally:
        browser.driver.quit()
        server.stop()


def test_ctrl_c_ends_it():
    server = Server("runs/klein.toml")
    server.process.send_signal(2)
    started = time.monotonic()
    server.process.communicate(timeout=PATIENCE)
    assert server.process.returncode == 0
    assert time.monotonic() - started < 30
