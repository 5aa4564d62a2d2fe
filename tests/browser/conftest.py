"""A real browser, and the page of the explorer in it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.support.ui import WebDriverWait

ROOT = Path(__file__).parents[2]
PATIENCE = 120

# The models of the page, by what they are called.
MODEL = "Bokeh.documents[0].get_model_by_name(arguments[0])"
# Change a property of a model as its widget does, and wait until the picture of that is drawn.
CHANGE = """
const done = arguments[arguments.length - 1]
const [name, property, value] = arguments
const find = (name) => Bokeh.documents[0].get_model_by_name(name)
const status = find("status")
const before = status.tags[0], start = performance.now()
find(name)[property] = value
const look = () => {
  if (status.tags[0] > before)
    // Figures draw in the next frame, or in the one after it if they drew a moment ago.
    requestAnimationFrame(() => requestAnimationFrame(() =>
      done([performance.now() - start, status.tags[1] < 0 ? "refused" : "drawn"])))
  else if (performance.now() - start > 60000)
    done([performance.now() - start, "never"])
  else
    setTimeout(look, 5)
}
look()
"""


class Server:
    """The program, serving its page."""

    def __init__(self, *arguments: str) -> None:
        program = Path(sys.executable).with_name("mesoslip")
        self.process = subprocess.Popen(
            [program, "explore", *arguments, "--no-browser", "--port", "0"],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        self.address = next(word for word in line.split() if word.startswith("http"))

    def memory(self) -> int:
        """Memory that it holds [bytes]."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return 1024 * int(status.split("VmRSS:")[1].split()[0])

    def computing_time(self) -> float:
        """Computing time that it took so far [s]."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def threads(self) -> int:
        """How many threads it has."""
        return len(list(Path(f"/proc/{self.process.pid}/task").iterdir()))

    def stop(self) -> None:
        self.process.terminate()
        self.process.communicate(timeout=PATIENCE)


class Browser:
    """Chromium without a screen, by its driver."""

    def __init__(self) -> None:
        options = webdriver.ChromeOptions()
        options.binary_location = str(shutil.which("chromium"))
        for argument in (
            "--headless=new",
            "--no-sandbox",
            "--disable-dev-shm-usage",
            "--window-size=1500,1400",
            # Whoever asks for a name gets no answer.
            "--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1 , EXCLUDE localhost",
        ):
            options.add_argument(argument)
        options.set_capability("goog:loggingPrefs", {"performance": "ALL", "browser": "ALL"})
        self.driver = webdriver.Chrome(options, Service(str(shutil.which("chromedriver"))))
        self.driver.set_script_timeout(PATIENCE)

    def open(self, address: str) -> None:
        """Open a page, and wait for its first picture.

        Errors of pages before it are dropped: one whose program was ended goes on asking for it.
        """
        self.driver.get("about:blank")
        self.driver.get_log("browser")
        self.driver.get(address)
        self.wait("return window.Bokeh && Bokeh.documents.length > 0")
        self.wait("return Bokeh.documents[0].get_model_by_name('status').tags.length > 1")

    def wait(self, script: str, *arguments: object) -> None:
        WebDriverWait(self.driver, PATIENCE, 0.02).until(
            lambda driver: driver.execute_script(script, *arguments)
        )

    def wait_until_done(self) -> None:
        """Wait for the end of the run."""
        self.wait("return Bokeh.documents[0].get_model_by_name('status').text == 'done'")

    def value(self, name: str, what: str):
        """A property of a model."""
        return self.driver.execute_script(f"return {MODEL}.{what}", name)

    def data(self, name: str, column: str = "y") -> list[float]:
        """The numbers of a picture."""
        return self.driver.execute_script(
            f"return Array.from({MODEL}.data[arguments[1]])", name, column
        )

    def change(self, name: str, value: object, property_: str = "value") -> tuple[float, str]:
        """Change a model; seconds until that is drawn, and what became of it."""
        milliseconds, became = self.driver.execute_async_script(CHANGE, name, property_, value)
        return milliseconds / 1000, became

    def element(self, name: str, selector: str):
        """An element of a widget, which lies in a shadow of its own."""
        script = f"""
          const view = Bokeh.index.find_one({MODEL})
          return view.shadow_el.querySelector(arguments[1])
        """
        return self.driver.execute_script(script, name, selector)

    def requests(self) -> list[str]:
        """Everything that was asked for since the last time."""
        messages = [
            json.loads(entry["message"])["message"] for entry in self.driver.get_log("performance")
        ]
        found = []
        for message in messages:
            if message["method"] == "Network.requestWillBeSent":
                found.append(message["params"]["request"]["url"])
            if message["method"] == "Network.webSocketCreated":
                found.append(message["params"]["url"])
        return found

    def errors(self) -> list[str]:
        """What the browser complained of since the page was opened, or since the last time."""
        return [
            entry["message"]
            for entry in self.driver.get_log("browser")
            if entry["level"] == "SEVERE"
        ]


def is_here(url: str) -> bool:
    """Whether an address is of this machine, or of no machine at all."""
    parts = urlsplit(url)
    return parts.scheme in {"data", "blob", "chrome"} or parts.hostname == "127.0.0.1"


@pytest.fixture(scope="module")
def server():
    one = Server("runs/klein.toml")
    yield one
    one.stop()


@pytest.fixture(scope="module")
def browser():
    one = Browser()
    yield one
    one.driver.quit()


def eventually(is_so, patience: float = 30.0) -> bool:
    """Whether something comes to be so."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        if is_so():
            return True
        time.sleep(0.1)
    return False
