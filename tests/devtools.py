"""Chromium, driven through its DevTools protocol, and the live page without a browser: to move, click and listen."""

import asyncio
import base64
import json
import shutil
import subprocess
import time
import urllib.request
from pathlib import Path
from urllib.parse import urlsplit

from tornado import httpclient
from tornado.websocket import websocket_connect

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
HOW = (
    *(
        "--headless=new",
        "--no-sandbox",
        "--disable-background-networking",
        "--no-first-run",
        "--remote-debugging-port=0",
    ),
    *("--disable-gpu", "--hide-scrollbars", "--disable-extensions"),
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
)


class Browser:
    """Chromium without a window, its profile in a folder."""

    def __init__(self, folder: Path) -> None:
        self.loop = asyncio.new_event_loop()
        self.process = subprocess.Popen(
            [CHROMIUM, *HOW, f"--user-data-dir={folder}", "about:blank"], stderr=subprocess.DEVNULL
        )
        port_file, end = folder / "DevToolsActivePort", time.monotonic() + 60
        while not (port_file.exists() and port_file.read_text().count("\n")):
            assert self.process.poll() is None, "chromium has ended"
            assert time.monotonic() < end, "chromium does not begin"
            time.sleep(0.05)
        self.address = f"http://127.0.0.1:{port_file.read_text().split()[0]}"

    def open(self, address: str, width: int = 1400, height: int = 1000) -> "Tab":
        """A page in a tab of its own."""
        request = urllib.request.Request(f"{self.address}/json/new?about:blank", method="PUT")
        with urllib.request.urlopen(request) as answer:
            about = json.load(answer)
        tab = Tab(self, about["webSocketDebuggerUrl"], about["id"])
        tab.resize(width, height)
        tab.ask("Page.navigate", url=address)
        return tab

    def close(self) -> None:
        """End it."""
        self.process.kill()
        self.process.wait()
        self.loop.close()


class Tab:
    """A page: what it was told, what it said and what it asked of the network."""

    def __init__(self, browser: Browser, address: str, name: str) -> None:
        self.browser, self.name, self.number = browser, name, 0
        self.errors: list[str] = []
        self.asked: list[str] = []

        async def connected():
            return await websocket_connect(address, max_message_size=2**28)

        self.line = browser.loop.run_until_complete(connected())
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.ask(f"{domain}.enable")

    def ask(self, method: str, **parameters):
        """What a command of the protocol answers."""
        self.number += 1
        message = json.dumps({"id": self.number, "method": method, "params": parameters})

        async def answered():
            await self.line.write_message(message)
            while True:
                text = await self.line.read_message()
                assert text is not None, "the tab is gone"
                said = json.loads(text)
                if said.get("id") == self.number:
                    return said
                self._listen(said)

        said = self.browser.loop.run_until_complete(asyncio.wait_for(answered(), 60))
        assert "error" not in said, said
        return said["result"]

    def _listen(self, said):
        method, about = said["method"], said.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.errors.append(json.dumps(about["exceptionDetails"])[:2000])
        elif method == "Runtime.consoleAPICalled" and about["type"] in ("error", "assert"):
            self.errors.append(json.dumps(about["args"])[:2000])
        elif method == "Log.entryAdded" and about["entry"]["level"] == "error":
            self.errors.append(json.dumps(about["entry"])[:2000])
        elif method == "Network.requestWillBeSent":
            self.asked.append(about["request"]["url"])
        elif method == "Network.webSocketCreated":
            self.asked.append(about["url"])

    def run(self, program: str):
        """The value of an expression of JavaScript, awaited."""
        answer = self.ask("Runtime.evaluate", expression=program, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def until(self, program: str, seconds: float = 40.0):
        """The first value of an expression that is true."""
        end = time.monotonic() + seconds
        while not (value := self.run(program)):
            assert time.monotonic() < end, f"never true: {program}; errors: {self.errors}"
            time.sleep(0.05)
        return value

    def resize(self, width: int, height: int) -> None:
        """The window, as on a desk or on a phone."""
        self.ask(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )

    def mouse(self, *places: tuple[float, float]) -> None:
        """Press at the first place, go to the others, and let go at the last."""
        for kind, (x, y) in (("mousePressed", places[0]), *(("mouseMoved", p) for p in places[1:])):
            buttons = {"button": "left", "buttons": 1, "clickCount": 1}
            self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, **buttons)
        x, y = places[-1]
        self.ask("Input.dispatchMouseEvent", type="mouseReleased", x=x, y=y, button="left", clickCount=1)

    def picture(self, path: Path) -> None:
        """The whole page as a PNG."""
        data = self.ask("Page.captureScreenshot", format="png", captureBeyondViewport=True)["data"]
        path.write_bytes(base64.b64decode(data))

    def close(self) -> None:
        """Close the page."""
        with urllib.request.urlopen(f"{self.browser.address}/json/close/{self.name}"):
            self.line.close()


class LivePage:
    """A page of `spinlev explore` without a browser: what it is told to show, and what its reader does."""

    def __init__(self, address: str, query: str = "") -> None:
        self.loop = asyncio.new_event_loop()
        self.shown: dict[str, object] = {}
        parts = urlsplit(address)
        line = f"ws://{parts.netloc}/ws?{parts.query}{query and '&' + query}"
        try:
            self.line = self.loop.run_until_complete(self._joined(httpclient.HTTPRequest(line, request_timeout=60)))
        except BaseException:
            self.loop.close()
            raise

    async def _joined(self, line):
        return await websocket_connect(line, max_message_size=2**28)

    async def _heard(self):
        return await self.line.read_message()

    @property
    def names(self) -> list[str]:
        """Of the sliders."""
        return [slider["name"] for slider in self.shown.get("controls", {}).get("sliders", [])]

    @property
    def said(self) -> str:
        """The message to the reader, and the headline."""
        return f"{self.shown.get('message') or ''} {self.shown.get('numbers', {}).get('headline', '')}".strip()

    def say(self, *words: object) -> None:
        """What the page's reader does, as page.js sends it."""

        async def sent():
            await self.line.write_message(json.dumps(words))

        self.loop.run_until_complete(sent())

    def until(self, true, seconds: float = 120.0):
        """Hear what the page is told until something is true, and what that is."""
        end = time.monotonic() + seconds
        while not (found := true()):
            try:
                text = self.loop.run_until_complete(asyncio.wait_for(self._heard(), end - time.monotonic()))
            except TimeoutError:
                raise AssertionError(f"never true; {self.said}") from None
            assert text is not None, f"the line was closed: {self.line.close_code} {self.line.close_reason}"
            self.shown |= json.loads(text)
        return found

    def answered(self, seconds: float = 120.0) -> str:
        """What is said when an answer or a message is there."""
        return str(self.until(lambda: self.said, seconds))

    def close(self) -> None:
        """Leave."""
        if self.loop.is_closed():
            return

        async def left():
            self.line.close()

        self.loop.run_until_complete(left())
        self.loop.close()
