"""A headless Chromium, steered over its DevTools protocol: what a page asks for, what it complains of, how it looks."""

from __future__ import annotations

import base64
import fcntl
import json
import os
import shutil
import subprocess
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
# A laboratory's browser: no sandbox, since tests may run as root, and nothing that calls home by itself.
OPTIONS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-default-apps",
    "--disable-extensions",
    "--disable-sync",
    "--hide-scrollbars",
    "--no-first-run",
    "--remote-debugging-pipe",
)


def find() -> str | None:
    """Path of a Chromium: $HSSLAM_CHROMIUM, or one on the path."""
    return os.environ.get("HSSLAM_CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)


@dataclass
class Heard:
    """What happened since the browser began."""

    requests: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)
    loaded: bool = False


class Browser:
    """One tab of a browser; a context manager."""

    def __init__(self, executable: str) -> None:
        self.heard = Heard()
        self._home = tempfile.TemporaryDirectory(prefix="hsslam-browser-", ignore_cleanup_errors=True)
        to_browser, commands = os.pipe()
        answers, from_browser = os.pipe()
        # Away from 3 and 4, on which the browser expects them: one must not overwrite the other.
        ends = [fcntl.fcntl(end, fcntl.F_DUPFD, 10) for end in (to_browser, from_browser)]

        def place() -> None:
            os.dup2(ends[0], 3)
            os.dup2(ends[1], 4)

        self._process = subprocess.Popen(
            [executable, *OPTIONS, f"--user-data-dir={self._home.name}", "about:blank"],
            pass_fds=[3, 4],
            preexec_fn=place,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        for end in (*ends, to_browser, from_browser):
            os.close(end)
        self._commands, self._answers = os.fdopen(commands, "wb"), os.fdopen(answers, "rb")
        self._sent = 0
        self._rest = b""
        self._session = ""
        target = self.do("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.do("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Network", "Runtime", "Log"):
            self.do(f"{domain}.enable")

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *_: object) -> None:
        self._commands.close()
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._answers.close()
        self._home.cleanup()

    def do(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command and return its result."""
        self._sent += 1
        message: dict[str, Any] = {"id": self._sent, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        self._commands.write(json.dumps(message).encode() + b"\0")
        self._commands.flush()
        while True:
            answer = self._next()
            if answer.get("id") == self._sent:
                assert "error" not in answer, (method, answer["error"])
                result: dict[str, Any] = answer["result"]
                return result

    def open(self, page: Path, width: int, height: int, mobile: bool = False) -> None:
        """Show a page in a window of a size (CSS pixels), until it is loaded."""
        self.do(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=mobile,
        )
        self.heard.loaded = False
        self.do("Page.navigate", url=page.resolve().as_uri())
        while not self.heard.loaded:
            self._next()

    def evaluate(self, expression: str) -> Any:
        """Value of a JavaScript expression in the page."""
        return self.do("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def screenshot(self, path: Path, whole: bool = True) -> None:
        """Save what the page looks like as PNG."""
        taken = self.do("Page.captureScreenshot", captureBeyondViewport=whole)
        path.write_bytes(base64.b64decode(taken["data"]))

    def pdf(self) -> bytes:
        """The page printed on A4."""
        printed = self.do("Page.printToPDF", paperWidth=8.27, paperHeight=11.69, printBackground=True)
        return base64.b64decode(printed["data"])

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            chunk = os.read(self._answers.fileno(), 1 << 20)
            if not chunk:
                raise RuntimeError("the browser has gone")
            self._rest += chunk
        line, _, self._rest = self._rest.partition(b"\0")
        message: dict[str, Any] = json.loads(line)
        self._note(message.get("method", ""), message.get("params", {}))
        return message

    def _note(self, method: str, told: dict[str, Any]) -> None:
        heard = self.heard
        match method:
            case "Network.requestWillBeSent":
                heard.requests.append(told["request"]["url"])
            case "Network.loadingFailed":
                heard.complaints.append(f"loading failed: {told.get('errorText')}")
            case "Runtime.consoleAPICalled" if told["type"] in ("error", "warning", "assert"):
                heard.complaints.append(str(told["args"]))
            case "Runtime.exceptionThrown":
                heard.complaints.append(str(told["exceptionDetails"]))
            case "Log.entryAdded" if told["entry"]["level"] in ("error", "warning"):
                heard.complaints.append(told["entry"]["text"])
            case "Page.loadEventFired":
                heard.loaded = True
