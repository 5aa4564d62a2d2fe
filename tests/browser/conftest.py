"""A real browser, and the page of the explorer in it."""

import json
import os
import shutil
import subprocess
import sys
import time
from importlib.resources import files
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

ROOT = Path(__file__).parents[2]
PATIENCE = 120
AXE = files("axe_core_python").joinpath("axe.min.js").read_text("utf-8")

# The models of the page, by what they are called.
MODEL = "Bokeh.documents[0].get_model_by_name(arguments[0])"
# Change an element as a hand does, or click it, and wait until the picture of that is drawn.
CHANGE = """
const done = arguments[arguments.length - 1]
const [name, value] = arguments
const one = document.getElementById(name), status = document.getElementById("status").dataset
const before = Number(status.turn), start = performance.now()
if (value === null) one.click()
else {
  one.value = value
  for (const kind of ["input", "change"]) one.dispatchEvent(new Event(kind, {bubbles: true}))
}
const look = () => {
  if (Number(status.turn) > before)
    // Figures draw in the next frame, or in the one after it if they drew a moment ago.
    requestAnimationFrame(() => requestAnimationFrame(() =>
      done([performance.now() - start, status.part < 0 ? "refused" : "drawn"])))
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
        self.wait("return document.getElementById('status')?.dataset.turn > 0")

    def wait(self, script: str, *arguments: object) -> None:
        WebDriverWait(self.driver, PATIENCE, 0.02).until(
            lambda driver: driver.execute_script(script, *arguments)
        )

    def wait_until_done(self) -> None:
        """Wait for the end of the run."""
        self.wait("return document.getElementById('status').textContent == 'done'")

    def open_until_done(self, address: str) -> None:
        """Open a page, and wait for the end of its run."""
        self.open(address)
        self.wait_until_done()

    def value(self, name: str, what: str = "value"):
        """A property of an element."""
        return self.driver.execute_script(
            "return document.getElementById(arguments[0])[arguments[1]]", name, what
        )

    def text(self, name: str) -> str:
        """The text of an element."""
        return self.value(name, "textContent")

    def was(self, key: str) -> str:
        """What a knob says of its value at the start."""
        knob = self.element(f"knob:{key}")
        return knob.find_element(By.CLASS_NAME, "was").get_attribute("textContent")

    def model(self, name: str, what: str):
        """A property of a figure or of what it draws."""
        return self.driver.execute_script(f"return {MODEL}.{what}", name)

    def data(self, name: str, column: str = "y") -> list[float]:
        """The numbers of a picture."""
        return self.driver.execute_script(
            f"return Array.from({MODEL}.data[arguments[1]])", name, column
        )

    def change(self, name: str, value: object = None) -> tuple[float, str]:
        """Change an element, or click it; seconds until that is drawn, and what became of it."""
        milliseconds, became = self.driver.execute_async_script(CHANGE, name, value)
        return milliseconds / 1000, became

    def element(self, name: str):
        """An element."""
        return self.driver.find_element(By.ID, name)

    def findings(self) -> list[str]:
        """What axe-core finds serious or critical on the page."""
        self.driver.execute_script(AXE)
        script = """
          const done = arguments[arguments.length - 1]
          axe.run(document, {resultTypes: ["violations"]}).then(({passes, violations}) =>
            done([passes.length, violations.map(({impact, id, nodes}) =>
              [impact, `${id}: ${nodes[0].html} ${nodes[0].failureSummary}`])]))
        """
        passed, found = self.driver.execute_async_script(script)
        assert passed > 10
        return [text for impact, text in found if impact in {"serious", "critical"}]

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
